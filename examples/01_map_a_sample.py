"""Map the embedded sample and ask where things are.

     /------- depth, loops --------\\
    X0 --odometry-- X1 --odometry-- X2 ...     poses of keyframes
      \\            / |  \\
       \\ box and depth   \\
        L1 -- S1 -- c1    L2 -- S2 -- c2       position, size and class of every thing

All of it is one factor graph: `process_frame` adds a frame's measurements, and the map can be read at any time.
"""

from thingmap.datasets import open_sequence
from thingmap.detectors.spec import make_detector
from thingmap.mapper import SemanticMapper

# Every third frame of a table-top that is rendered on the fly; a path of your own recording goes here just as well.
sequence = open_sequence("sample:tabletop", stride=3, max_frames=20)

# "simulated" finds what the renderer knows to be there, with misses and false alarms. 02 has a detector of your own.
detector = make_detector("simulated?seed=1", sequence)

mapper = SemanticMapper(detector, source=sequence.name)
for frame in sequence:
    mapper.process_frame(frame)
things = mapper.object_map()

# Every answer is a probability: of being there, and of being a cup.
for answer in things.find("cup", min_probability=0.3):
    thing = answer.thing
    print(
        f"{thing.id}: P = {answer.probability:.2f}, at {thing.position.round(2)} m, ± {thing.position_std.round(3)} m"
    )
    print("  it may be", {label: round(p, 2) for label, p in thing.class_posterior.items() if p > 0.01})

# Why is that believed? What every view said of the thing, and what it could not see.
print(things.find("cup")[0].thing.explain())

things.save("tabletop.json")
