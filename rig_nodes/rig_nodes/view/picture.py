# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A picture of a view without a display: a viewer draws it with a software Vulkan driver and returns it.

`rig view` uses it. The viewer is started, queried and ended here within a bounded time.
"""

from __future__ import annotations

import io
import socket
import tempfile
import threading
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base import MAKER, RigError, atomic_write
from .palette import CURVES, OTHER, rgb
from .viewer import child, surroundings

if TYPE_CHECKING:
    import subprocess
    from types import TracebackType
    from typing import TypeVar

    from rerun.experimental import ViewerState

    Answer = TypeVar("Answer")

DRIVER_FOLDERS = ("/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d")
NO_DRIVER = "no picture without a software Vulkan driver; install the Debian package mesa-vulkan-drivers and try again"
SIZE = (1600, 1720)
PNG_HEAD = 33  # bytes of its signature and its first chunk
LONGEST = 60.0  # s; time limit of the whole picture
SAME = 10  # difference of red, green or blue up to which a pixel has a colour
SETTLED = 3  # successive equal images after which the drawing counts as finished
PAUSE = 0.25  # s between them


def software_driver() -> Path | None:
    """Return the description file of the software Vulkan driver (Mesa lavapipe), or None when it is not installed."""
    for folder in DRIVER_FOLDERS:
        for path in sorted(Path(folder).glob("lvp_icd*.json")):
            return path
    return None


def require_driver() -> Path:
    """Return the software Vulkan driver; when it is missing, RigError names the package with it."""
    driver = software_driver()
    if driver is None:
        raise RigError(NO_DRIVER)
    return driver


def take_picture(view: Path, picture: Path, longest: float = LONGEST, light: bool = False) -> list[str]:
    """Draw a view into a PNG and return what the viewer reports, as sentences.

    Parameters
    ----------
    view : Path
        File of the view.
    picture : Path
        The PNG to write.
    longest : float
        Time limit [s].
    light : bool
        True for dark letters on a light ground.

    Returns
    -------
    list of str
        The viewer's reports.

    Raises
    ------
    RigError
        When there is no software Vulkan driver, the picture cannot be written, or the viewer does not finish in time.
    """
    with HeadlessViewer(str(view), longest=longest) as viewer:
        image = viewer.image()
        reports = viewer.reports()
    if light:
        image = lightened(image)
    atomic_write(picture, marked(image))
    return reports


def marked(image: bytes) -> bytes:
    """Return a PNG with the text Software (PNG, 11.3.3.2) behind its head, which says that the rig made it."""
    text = b"tEXtSoftware\0" + MAKER.encode()
    chunk = (len(text) - 4).to_bytes(4, "big") + text + zlib.crc32(text).to_bytes(4, "big")
    return image[:PNG_HEAD] + chunk + image[PNG_HEAD:]


def lightened(image: bytes) -> bytes:
    """Return a PNG of the viewer with dark letters on a light ground, for paper.

    Without a window the viewer is always dark. This function inverts the lightness of each pixel and keeps its hue: it adds the
    same amount to red, green and blue. The colours of curves stand out from both grounds and are left unchanged.
    """
    from PIL import Image

    colours = np.asarray(Image.open(io.BytesIO(image)).convert("RGB")).astype(np.int16)
    high, low = colours.max(axis=2, keepdims=True), colours.min(axis=2, keepdims=True)
    curves = [rgb(name, demanded) for name in CURVES if name != OTHER for demanded in (False, True)]
    kept = np.logical_or.reduce([np.abs(colours - np.array(one, np.int16)).max(axis=2, keepdims=True) <= SAME for one in curves])
    turned = colours + np.where(kept, 0, 255 - high - low)
    out = io.BytesIO()
    Image.fromarray(turned.astype(np.uint8)).save(out, "png")
    return out.getvalue()


class HeadlessViewer:
    """A viewer without a window, as a context manager; every request to it is limited in time.

    Within the context, exceptions of the viewer's client (``client``, a rerun ViewerClient) become RigError.
    """

    def __init__(self, source: str, size: tuple[int, int] = SIZE, longest: float = LONGEST) -> None:
        """Prepare a viewer; entering the context starts it.

        Parameters
        ----------
        source : str
            A file, or the address of a live view.
        size : (int, int)
            Width and height [px].
        longest : float
            Time limit for everything within the context [s].
        """
        self.client = None
        self._source, self._size, self._longest = source, size, longest

    def __enter__(self) -> HeadlessViewer:
        driver = require_driver()
        self._folder = tempfile.TemporaryDirectory(prefix="rig-view-")
        self.process = None
        # not all calls of the client have a time limit, but they fail when the viewer has ended
        self._deadline = time.monotonic() + self._longest
        self._watchdog = threading.Timer(self._longest, self._kill)
        self._watchdog.start()
        try:
            folder = Path(self._folder.name)
            self.process, port = _start(self._source, self._size, driver, folder)
            self._connect(port)
        except BaseException as error:
            self.__exit__(type(error), error, None)
            raise
        return self

    def _kill(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()

    def __exit__(self, _kind: type[BaseException] | None, error: BaseException | None, _trace: TracebackType | None) -> None:
        self._watchdog.cancel()
        self._kill()
        self._folder.cleanup()
        if isinstance(error, (RuntimeError, ValueError, ConnectionError, OSError)) and not isinstance(error, RigError):
            late = time.monotonic() >= self._deadline
            reason = f"did not finish within {self._longest:g} s" if late else "gave up"
            raise RigError(f"no picture: the viewer {reason} ({' '.join(str(error).split())})") from None

    def state(self) -> ViewerState:
        """Return what the viewer holds and shows, a rerun ViewerState."""
        return self._answer(lambda: self.client.get_state())

    def screenshot(self, view: str | None = None) -> bytes:
        """Return a PNG of the whole window as it is now, or of the view with this id."""
        return self._answer(lambda: self.client.take_screenshot(view))

    def views(self, wanted: Callable[[str], bool] = lambda _name: True) -> list[tuple[str, bytes]]:
        """Return (name, PNG) of the views whose name is wanted."""
        while True:
            try:
                return [(view.name, self.screenshot(view.view_id)) for view in self.state().views if wanted(view.name)]
            except (RuntimeError, ConnectionError) as error:  # the viewer has meanwhile received a layout with other views
                if "not found" not in str(error) or self.process.poll() is not None:
                    raise

    def _answer(self, ask: Callable[[], Answer]) -> Answer:
        while True:
            try:
                return ask()
            except TimeoutError:  # one call timed out on a busy machine; the watchdog enforces the total limit
                if self.process.poll() is not None:
                    raise

    def image(self, view: str | None = None) -> bytes:
        """Return a PNG of the whole window, or of the view with this id, once it no longer changes."""
        last, same = b"", 0
        while same < SETTLED:
            image = self.screenshot(view)
            same = same + 1 if image == last else 0
            last = image
            time.sleep(PAUSE)
        return last

    def reports(self) -> list[str]:
        """Return the viewer's warnings and errors as sentences; empty when there are none."""
        return [f"{view.name}: {report.summary}" for view in self.state().views for report in view.reports]

    def _connect(self, port: int) -> None:
        """Wait until the viewer answers and shows something; raise the client's error when the viewer ends."""
        from rerun.experimental import ViewerClient

        while True:
            try:
                self.client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
                state = self.state()
                break
            except (RuntimeError, ConnectionError):
                if self.process.poll() is not None:
                    raise
                time.sleep(0.1)
        while state.loading or not state.recordings or not state.views:
            time.sleep(0.1)
            state = self.state()


def _start(source: str, size: tuple[int, int], driver: Path, folder: Path) -> tuple[subprocess.Popen, int]:
    """Start the viewer without a window and return its process and port; it stores its files in ``folder``."""
    environment = surroundings(folder)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        environment.pop(name, None)
    for name in ("TMPDIR", "XDG_RUNTIME_DIR", "XDG_DATA_HOME", "XDG_CACHE_HOME", "XDG_STATE_HOME"):
        environment[name] = str(folder)
    environment.update(VK_ICD_FILENAMES=str(driver), VK_DRIVER_FILES=str(driver), RUST_LOG="error")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    where = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--hide-welcome-screen"]
    return child([*where, "--window-size", f"{size[0]}x{size[1]}", source], environment), port
