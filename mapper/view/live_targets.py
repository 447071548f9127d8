"""Where a live view goes: a window, a page in a browser, a file; and whether it can."""

from __future__ import annotations

import os
import shutil
import socket
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...datasets.errors import InputError, UserError
from ..map.atomic import make_folder
from .rerun_package import import_rerun, new_recording

SUFFIX = ".rrd"
BESIDE_PYTHON = Path(sys.executable).with_name("rerun")  # where no environment is activated
WINDOW_PORT = 9876  # where rerun's window listens; one that is already open is used
LOCAL = "127.0.0.1"  # what is served is for this machine, and for those who forward its ports


@dataclass(frozen=True, slots=True)
class LiveTargets:
    """What the user asked for; at least one of them.

    Attributes:
        window: open rerun's window.
        port: of a page for a browser; data goes through the next port.
        file: to record to.
        overwrite: replace the file if it is there.
    """

    window: bool = False
    port: int | None = None
    file: Path | None = None
    overwrite: bool = False

    def check(self) -> None:
        """Raises `UserError` for everything that can be known beforehand; nothing is opened."""
        import_rerun()
        if self.window and self.port is not None:
            raise UserError("--view and --serve: a live view is a window or a page in a browser; leave out one of them")
        if self.window and not has_display():
            raise UserError(
                "--view: there is no display to open a window on; use --serve 9090 for a page in a browser (on another "
                "machine through `ssh -L 9090:localhost:9090 -L 9091:localhost:9091`), or --save FILE.rrd to look later"
            )
        if self.port is not None:
            for port in (self.port, self.port + 1):
                _check_port(port)
        if self.file is not None:
            _check_file(self.file, self.overwrite)

    def open(self, source: str) -> Any:
        """A recording, named `source`, that goes to all of them.

        Raises:
            UserError: the window does not open or the file cannot be written.
        """
        rr, recording, sinks = import_rerun(), new_recording(source), []
        if self.file is not None:
            make_folder(self.file.parent)
            sinks.append(_file_sink(self.file))
        if self.window:
            try:
                program = {} if shutil.which("rerun") else {"executable_path": str(BESIDE_PYTHON)}
                rr.spawn(port=WINDOW_PORT, connect=False, hide_welcome_screen=True, **program)
            except RuntimeError as error:
                raise UserError(f"--view: rerun's window does not open ({error}); use --serve 9090 or --save") from None
            sinks.append(rr.GrpcSink(f"rerun+http://{LOCAL}:{WINDOW_PORT}/proxy"))
        if self.port is not None:
            sinks.append(rr.GrpcServerSink(LOCAL, self.port + 1))
        recording.set_sinks(*sinks)
        if self.port is not None:
            rr.serve_web_viewer(web_port=self.port, open_browser=False)
        return recording

    @property
    def address(self) -> str | None:
        """What to open in a browser; None where nothing is served."""
        if self.port is None:
            return None
        return f"http://localhost:{self.port}/?url=rerun%2Bhttp://localhost:{self.port + 1}/proxy"


def has_display() -> bool:
    """Whether windows can be opened here."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _check_port(port: int) -> None:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOCAL, port))
        except OSError as error:
            raise UserError(f"--serve: port {port} cannot be used ({error.strerror}); choose another one") from None


def _check_file(file: Path, overwrite: bool) -> None:
    if file.suffix != SUFFIX:
        raise InputError(file, f"a name ending in {SUFFIX}", file.name, "choose another name for --save")
    if file.is_dir():
        raise InputError(file, "a file to write to", "a folder", "choose another name for --save")
    if file.exists() and not overwrite:
        raise InputError(file, "a new file", "an existing one", "choose another name or add --overwrite")


def _file_sink(file: Path) -> Any:
    try:
        return import_rerun().FileSink(str(file))
    except (OSError, RuntimeError, ValueError) as error:
        raise UserError(f"{file}: cannot be written ({error}); choose another place for --save") from None
