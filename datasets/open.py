"""One way in: a path, the name of a sample or the line of a synthetic world becomes a sequence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from . import folder, kitti, kitti_raw, pcd_folder, rgbd_scenes_v1, rgbd_scenes_v2, seven_scenes, tum, tum_keyframes
from .errors import InputError, UserError
from .path_options import split_options
from .ros import open as ros
from .sequence import Sequence
from .views import subset

SAMPLE_PREFIX = "sample:"
SYNTH_PREFIX = "synth:"


@dataclass(frozen=True, slots=True)
class Loader:
    """One layout of files.

    Attributes:
        dataset: what the user calls it.
        layout: the files it is recognised by, for people.
        find: the sequences of this layout at a path: folders, and files where the layout is one file.
        open: opens one of them; it takes the options as keywords.
        options: what may be told after the path, as `PATH?KEY=VALUE&KEY=VALUE`.
        suffixes: of a file that is a sequence alone.
    """

    dataset: str
    layout: str
    find: Callable[[Path], list[Path]]
    open: Callable[..., Sequence]
    options: tuple[str, ...] = ()
    suffixes: tuple[str, ...] = ()


LOADERS = (
    Loader("7scenes", seven_scenes.LAYOUT, seven_scenes.find_seven_scenes, seven_scenes.open_seven_scenes),
    Loader("tum", tum.LAYOUT, tum.find_tum, tum.open_tum),
    Loader("tum", tum_keyframes.LAYOUT, tum_keyframes.find_tum_keyframes, tum_keyframes.open_tum_keyframes),
    Loader(
        "rgbd-scenes-v1", rgbd_scenes_v1.LAYOUT, rgbd_scenes_v1.find_rgbd_scenes_v1, rgbd_scenes_v1.open_rgbd_scenes_v1
    ),
    Loader(
        "rgbd-scenes-v2", rgbd_scenes_v2.LAYOUT, rgbd_scenes_v2.find_rgbd_scenes_v2, rgbd_scenes_v2.open_rgbd_scenes_v2
    ),
    Loader("kitti", kitti.LAYOUT, kitti.find_kitti, kitti.open_kitti),
    Loader("kitti", kitti_raw.LAYOUT, kitti_raw.find_kitti_raw, kitti_raw.open_kitti_raw),
    Loader("pcd", pcd_folder.LAYOUT, pcd_folder.find_pcd_folder, pcd_folder.open_pcd_folder),
    Loader("ros", ros.LAYOUT, ros.find_bags, ros.open_bag, ros.OPTIONS, ros.SUFFIXES),
    Loader("folder", folder.LAYOUT, folder.find_folder, folder.open_folder),
)
DATASETS = tuple(dict.fromkeys(loader.dataset for loader in LOADERS))


def open_sequence(
    spec: str | Path, dataset: str | None = None, stride: int = 1, max_frames: int | None = None
) -> Sequence:
    """Opens a recorded sequence, a bundled sample or a synthetic world.

    Args:
        spec: a folder or a bag of ROS, after which options may be told (`bag.mcap?color=TOPIC&depth=TOPIC`, see
            `ros.open.open_bag`); `sample:NAME`; or `synth:PRESET` with parameters as `synthetic.synth.parse_synth`
            reads them.
        dataset: one of `DATASETS`; None to tell by the files in the folder.
        stride: take every n-th frame.
        max_frames: take at most so many of those; None for all.

    Raises:
        InputError: there is no such folder, nothing in it is recognised, or it holds several sequences.
        UserError: an argument or an option is wrong, or there is no such sample or synthetic world.
    """
    if str(spec).startswith(SAMPLE_PREFIX):
        from .synthetic.sample import open_sample  # the renderer is slow to import, and recordings do not need it

        return subset(open_sample(str(spec).removeprefix(SAMPLE_PREFIX)), stride, max_frames)
    if str(spec).startswith(SYNTH_PREFIX):
        from .synthetic.synth import open_synth  # slow to import, too

        return subset(open_synth(str(spec)), stride, max_frames)
    path, options = split_options(spec)
    loader, place = _choose(path, dataset)
    unknown = sorted(set(options) - set(loader.options))
    if unknown:
        known = f"known are {', '.join(loader.options)}" if loader.options else f"{loader.dataset} has no options"
        raise UserError(f"{path}: unknown option {unknown[0]!r}; {known}")
    return subset(loader.open(place, **options), stride, max_frames)


def _choose(path: Path, dataset: str | None) -> tuple[Loader, Path]:
    if dataset is not None and dataset not in DATASETS:
        raise UserError(f"unknown dataset {dataset!r}; known are {', '.join(DATASETS)}")
    loaders = [loader for loader in LOADERS if dataset in (None, loader.dataset)]
    if path.is_file():
        loaders = [loader for loader in loaders if path.suffix.lower() in loader.suffixes]
    if not path.is_dir() and not (path.is_file() and loaders):
        found = "a file" if path.exists() else "no such folder"
        expected = f"the folder of a sequence ({dataset or ', '.join(DATASETS)})"
        raise InputError(path, expected, found, f"check the path, or use {SAMPLE_PREFIX}NAME or {SYNTH_PREFIX}PRESET")
    candidates = [(loader, place) for loader in loaders for place in loader.find(path)]
    if len(candidates) == 1:
        return candidates[0]
    if candidates:
        found = ", ".join(f"{place} ({loader.dataset})" for loader, place in candidates[:8])
        more = f" and {len(candidates) - 8} more" if len(candidates) > 8 else ""
        raise InputError(path, "one sequence", found + more, "give one of these folders, and its dataset if need be")
    if dataset == "folder":
        return loaders[0], path  # its own errors say which part is missing
    if (path / "map.json").is_file():
        remedy = "`thingmap query`, `view` and `info` read maps; give the folder that holds a sequence"
        raise InputError(path, "a sequence", "the map that a run wrote", remedy)
    looked_for = "; or ".join(f"{loader.layout} ({loader.dataset})" for loader in loaders)
    raise InputError(path, looked_for, contents(path), "give the folder that holds a sequence")


def contents(path: Path) -> str:
    """What is in a folder, for people: the first names, and how many more."""
    names = sorted(entry.name for entry in path.iterdir())
    if not names:
        return "an empty folder"
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
