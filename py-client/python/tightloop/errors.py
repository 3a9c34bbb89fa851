"""The exceptions and the warning of tightloop. Each message says what is wrong and how to fix it.

All derive from `TightloopError`. Where Python has a built-in exception for the mistake (`ValueError`, `TimeoutError`,
…), the exception also derives from that one, so that ordinary `except` clauses work.
"""

from __future__ import annotations

from tightloop.terminal import printable


class TightloopError(Exception):
    """Base class of all exceptions of this package."""

    def __str__(self) -> str:
        """Return the message; codes for terminals, which names in files may hold, are shown and not obeyed."""
        return printable(super().__str__())


class TightloopWarning(UserWarning):
    """What is valid and most likely a mistake; the message names it and the cure. A process reports each one once.

    ``warnings.simplefilter("error", tl.TightloopWarning)`` makes errors of them, ``"ignore"`` hides them.
    """


class ArgumentError(TightloopError, ValueError):
    """An argument of a function or class is not valid; the message names it and what is valid."""


class SignatureError(TightloopError, TypeError):
    """A call has an argument that does not exist, too many, or too few; the message names it and the call."""


class SceneError(TightloopError, ValueError):
    """A scene, or a value written into one, is not valid. The message names the part and the fix."""


class UrdfError(SceneError):
    """A URDF file cannot be read, or describes a robot that cannot be simulated."""


class LaunchError(TightloopError, RuntimeError):
    """The daemon could not be started; the message has the reason."""


class ResourceError(LaunchError):
    """There is not enough memory, or not enough shared memory, for the number of worlds."""


class MissingLibrary(TightloopError, ImportError):
    """An optional library is not installed; the message says how to install it."""


class UnknownDaemon(TightloopError, LookupError):
    """No daemon of that name is running; the message lists those that are."""


class ProtocolMismatch(TightloopError, RuntimeError):
    """Client and daemon have different versions; the message names both."""


class TransportError(TightloopError, OSError):
    """The shared-memory transport failed; the message has the reason."""


class LeaseHeld(TightloopError, RuntimeError):
    """Another client controls the daemon; the message names its process."""


class LeaseLost(TightloopError, RuntimeError):
    """This client lost control of the daemon, because it did not answer for too long."""


class DaemonLost(TightloopError, ConnectionError):
    """The daemon ended or was killed; its state is lost. Frames already received stay valid."""


class DaemonRestarted(DaemonLost):
    """Another daemon of the same name has replaced the one that this client knew, whose state is lost."""


class SimClosed(TightloopError, RuntimeError):
    """The simulation was closed; frames already received stay valid."""


class CommandRefused(TightloopError, ValueError):
    """A command has a wrong shape, dtype or value; the message names field, world and dof. The daemon continues."""


class CallInProgress(CommandRefused):
    """A signal handler called a simulation while a call of the same one waited. Set a flag in the handler instead.

    The call in the handler changed nothing. ``close`` and ``release`` are allowed there.
    """


class ConstantParameter(CommandRefused, AttributeError):
    """A parameter is constant in this run; the message says how to let it vary."""


class SnapshotError(TightloopError, ValueError):
    """A snapshot is damaged, does not fit, or cannot be written; the message says which. No world changed."""


class OutputError(TightloopError, OSError):
    """A file cannot be written; the message has the reason. A file that was there is unchanged."""


class RecordingError(TightloopError, ValueError):
    """A recording cannot be read to its end, or the files of its scene are missing or have changed."""


class UnknownAttribute(TightloopError, AttributeError):
    """An object has no attribute of that name, or it can only be read; the message suggests another."""


class UnknownName(TightloopError, KeyError):
    """A scene or a simulation has nothing of that name; the message suggests another."""

    def __str__(self) -> str:  # KeyError's has quotes around it
        return printable(str(self.args[0]))


class UnknownField(TightloopError, AttributeError):
    """Frames of this run do not carry the field; add it to ``fields`` at launch."""


class FramesHeld(TightloopError, RuntimeError):
    """Too many frames are alive at once: use ``frame.copy()``, or launch with a larger ``frames_held``."""


class GpuMemoryError(TightloopError, RuntimeError):
    """Frames and commands cannot stay on the GPU; the message names what is missing. Arrays of the host work on."""


class WaitTimeout(TightloopError, TimeoutError):
    """The daemon is alive but did not answer in time."""
