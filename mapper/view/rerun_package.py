"""rerun, where it is installed: an extra of thingmap that nothing but these viewers imports."""

from __future__ import annotations

from typing import Any

from ...datasets.errors import UserError
from ...datasets.extras import install_command

EXTRA = "view"
APPLICATION = "thingmap"


def import_rerun() -> Any:
    """The module `rerun`.

    Raises:
        UserError: it is not installed, or is of another kind than is known here.
    """
    try:
        import rerun
        import rerun.blueprint
    except ImportError as error:
        raise UserError(f"the live view needs rerun ({error}); install it with: {install_command(EXTRA)}") from None
    if not hasattr(rerun, "GrpcServerSink"):
        version = getattr(rerun, "__version__", "another package of that name")
        remedy = f"install it with: {install_command(EXTRA)}"
        raise UserError(f"the live view needs a newer rerun-sdk, found {version}; {remedy}")
    return rerun


def new_recording(source: str) -> Any:
    """A `rerun.RecordingStream` without sinks, named after what is mapped.

    Of rerun's own clocks none is recorded: what was logged when says nothing about a map, and makes two recordings of
    the same run differ.
    """
    rr = import_rerun()
    recording = rr.RecordingStream(APPLICATION)
    rr.set_log_time_enabled(False, recording=recording)
    rr.set_log_tick_enabled(False, recording=recording)
    recording.send_recording_name(source)
    return recording
