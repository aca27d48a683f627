"""Panel of the live page for uploading a motion file, which is prepared and then offered among the clips."""

import time
from typing import Any

import viser

from experiments.live.panels import Acts
from experiments.live.session.desk import MAX_UPLOAD_BYTES, Desk


class UploadsPanel:
    """Upload and its progress; the arguments are those of `ClockPanel`."""

    def __init__(self, gui: viser.GuiApi, desk: Desk, acts: Acts):
        self._desk = desk
        gui.add_markdown(
            "A **BVH**, or an **ASF** and then its **AMC**: calibrated, put on the floor, looped or at rest, made "
            "feasible on contact, as `hvf prepare` does. It is then the first of the clips under *Play*."
        )
        self._upload = gui.add_upload_button(
            f"Upload a motion (up to {MAX_UPLOAD_BYTES // 1_000_000} MB)", icon=viser.Icon.UPLOAD
        )
        self._status = gui.add_markdown("", visible=False)
        self._bar = gui.add_progress_bar(100.0, visible=False, animated=True)
        self._ready_text = gui.add_markdown("")
        self._upload.on_upload(acts(self._on_upload))

    def write(self) -> None:
        """Show the file being prepared and the clips that are ready."""
        preparing = self._desk.preparing
        self._bar.visible = self._status.visible = preparing is not None
        if preparing is not None:
            name, since = preparing
            self._status.content = f"Preparing **{name}**: {time.monotonic() - since:.0f} s so far, of ten to sixty."
        if self._desk.clips:
            self._ready_text.content = "Ready: " + ", ".join(f"**{name}**" for name in self._desk.clips)

    def _on_upload(self, event: Any) -> None:
        file = self._upload.value
        self._desk.upload(file.name, file.content)
