"""Vulkan's validation layer over daemons and everything else that the tests start."""

from __future__ import annotations

import os
from pathlib import Path

# Errors, warnings and hazards between commands; few of a kind, since a pipe has room for some dozens
SETTINGS = """khronos_validation.debug_action = VK_DBG_LAYER_ACTION_LOG_MSG
khronos_validation.report_flags = error,warn
khronos_validation.duplicate_message_limit = 3
khronos_validation.enables = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT
khronos_validation.log_filename = {}
"""


class Layer:
    """The layer, on from now on in all processes that are started; its words come out of a pipe.

    A file would not do: the layer begins it anew with each instance of Vulkan.
    """

    def __init__(self, folder: Path) -> None:
        words, settings = folder / "words", folder / "settings.txt"
        os.mkfifo(words)
        # for both directions, so that nobody waits for a reader, and a daemon that ends does not end it
        self._words = os.open(words, os.O_RDWR | os.O_NONBLOCK)
        settings.write_text(SETTINGS.format(words))
        os.environ["VK_INSTANCE_LAYERS"] = "VK_LAYER_KHRONOS_validation"
        os.environ["VK_LAYER_SETTINGS_PATH"] = str(settings)

    def words(self) -> str:
        """What the layer has said since this was asked last."""
        try:
            return os.read(self._words, 1 << 20).decode()
        except BlockingIOError:
            return ""

    def close(self) -> None:
        os.close(self._words)
