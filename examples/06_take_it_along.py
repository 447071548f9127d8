"""From a run's folder to files that other tools open, and a page for a colleague.

The same from a shell: `thingmap run sample:tabletop -o out`, `thingmap export out -o map.glb`,
`thingmap export out -o map.html`.
"""

import subprocess
from pathlib import Path

from thingmap.mapper import ObjectMap
from thingmap.mapper.edits.editor import MapEditor
from thingmap.mapper.export import exporter
from thingmap.mapper.map.store import OutputFolder

out = Path("out")
run = ["thingmap", "run", "sample:tabletop", "--stride", "3", "--max-frames", "20", "-o", str(out)]
subprocess.run(run, check=True)

# People know things that no camera sees. What they say is kept apart from what was estimated, and can be undone.
editor = MapEditor(out, who="somebody")
cup = ObjectMap.load(out).find("cup")[0].thing
editor.name(cup, "my cup", why="it has my name on its bottom")
print([answer.thing.id for answer in ObjectMap.load(out).find("my cup")])

folder = OutputFolder.open(out)
for name, file in (("glb", "map.glb"), ("geojson", "plan.geojson"), ("tum", "path.tum"), ("html", "map.html")):
    count = exporter(name)(folder, Path(file))
    print(f"{file}: {count} {'poses' if name == 'tum' else 'things'}, {Path(file).stat().st_size / 1024:.0f} KiB")
