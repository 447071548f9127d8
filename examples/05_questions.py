"""Questions to a map: what is near, what stands on what, what can be seen, where to look next."""

from thingmap.datasets import open_sequence
from thingmap.detectors.spec import make_detector
from thingmap.mapper import SemanticMapper

sequence = open_sequence("sample:tabletop", stride=3, max_frames=24)
mapper = SemanticMapper(make_detector("simulated?seed=1", sequence), source=sequence.name)
for frame in sequence:
    mapper.process_frame(frame)
things = mapper.object_map()
_, poses = mapper.trajectory()

# Words: labels, synonyms, or a name that somebody gave. "drinking cup" is understood as the class "cup".
cup = things.find("cup")[0].thing

print("the three nearest to the", cup.label)
for answer in [a for a in things.nearest(cup.position) if a.thing.id != cup.id][:3]:
    print(f"  {answer.thing.label}: {answer.distance:.2f} ± {answer.distance_std:.2f} m")

print("within 30 cm of it:", len(things.within((cup.position, 0.3))), "things, with it")

# Relations come from volumes with their uncertainty: each is a probability, not a yes or no.
for name, relation in (("next to", things.next_to), ("on", things.on), ("under", things.under)):
    answers = relation(cup, min_probability=0.1)
    print(f"{name} it:", ", ".join(f"{a.thing.label} ({a.probability:.2f})" for a in answers) or "nothing")

print("to be seen from the last pose:")
for sighting in things.visible_from(poses[-1], sequence.intrinsics)[:3]:
    print(f"  {sighting.thing.label} ({sighting.probability:.2f})")

print("where the next look would tell most about cups:")
for viewpoint in things.where_to_look("cup", count=2, camera=sequence.intrinsics):
    where = viewpoint.T_world_camera[:3, 3].round(2)
    print(f"  from {where} m: {viewpoint.gain_bits:.2f} bits about {', '.join(viewpoint.things)}")
