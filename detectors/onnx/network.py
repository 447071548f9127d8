"""Running an ONNX network with OpenCV or, where it is installed, onnxruntime."""

from __future__ import annotations

from enum import Enum
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from ...datasets.errors import InputError, UserError
from ...datasets.extras import install_command


class Backend(Enum):
    """Which library runs the network. `AUTO` takes onnxruntime where it is installed: it is the faster one."""

    AUTO = "auto"
    OPENCV = "opencv"
    ONNXRUNTIME = "onnxruntime"


class Network(Protocol):
    """A loaded network. One input blob (1, 3, H, W) to all outputs."""

    def __call__(self, blob: np.ndarray, /) -> list[np.ndarray]: ...


def load_network(path: Path, backend: Backend) -> Network:
    """The network of an ONNX file.

    Raises:
        InputError: where the library cannot read the network.
        UserError: where onnxruntime is asked for and not installed.
    """
    installed = find_spec("onnxruntime") is not None
    if backend is Backend.ONNXRUNTIME and not installed:
        remedy = f"install it with: {install_command('onnxruntime')}, or use backend=opencv"
        raise UserError(f"backend onnxruntime is not installed; {remedy}")
    if backend is Backend.OPENCV or not installed:
        return OpenCvNetwork(path)
    return OnnxRuntimeNetwork(path)


class OpenCvNetwork:
    """cv2.dnn on the CPU. Not to be shared between threads."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._net = cv2.dnn.readNetFromONNX(str(path))
        except cv2.error as error:
            raise _not_runnable(path, "OpenCV", error) from None
        self._outputs = self._net.getUnconnectedOutLayersNames()

    def __call__(self, blob: np.ndarray, /) -> list[np.ndarray]:
        try:
            self._net.setInput(blob)
            return [np.array(output) for output in self._net.forward(self._outputs)]
        except cv2.error as error:
            raise _not_runnable(self.path, "OpenCV", error) from None


class OnnxRuntimeNetwork:
    """onnxruntime on the CPU."""

    def __init__(self, path: Path) -> None:
        import onnxruntime  # type: ignore[import-not-found]

        self.path = path
        try:
            self._session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
        except Exception as error:  # its exceptions have no common base class
            raise _not_runnable(path, "onnxruntime", error) from None
        self._input = self._session.get_inputs()[0].name

    def __call__(self, blob: np.ndarray, /) -> list[np.ndarray]:
        try:
            return self._session.run(None, {self._input: blob})
        except Exception as error:
            raise _not_runnable(self.path, "onnxruntime", error) from None


def _not_runnable(path: Path, library: str, error: Exception) -> InputError:
    reason = " ".join(str(getattr(error, "err", error)).split())[:300]  # OpenCV's `err` leaves out its source lines
    remedy = "export with static shapes and without post-processing in the graph, or try the other backend"
    return InputError(path, f"a network that {library} can run", reason, remedy)
