"""Every exception that tightloop raises on its own account; each says what is wrong and what to do.

All derive from `TightloopError`. Where Python has a word for the mistake (`ValueError`, `TimeoutError`, …) the
exception derives from that too, so that ordinary `except` clauses work.
"""

from __future__ import annotations


class TightloopError(Exception):
    """Base of all exceptions of this package."""


class ArgumentError(TightloopError, ValueError):
    """An argument of `launch` or `attach` is not valid; the message lists what is."""


class SceneError(TightloopError, ValueError):
    """A scene, or a value written into one, is not valid. The message names the part and the cure."""


class UrdfError(SceneError):
    """A URDF file cannot be read, or describes a robot that cannot be simulated."""


class LaunchError(TightloopError, RuntimeError):
    """The daemon could not be started; the message holds its reason."""


class ResourceError(LaunchError):
    """There is not enough memory, or not enough room in shared memory, for that many worlds."""


class MissingLibrary(TightloopError, ImportError):
    """An adapter's library is not installed; the message says how to install it."""


class UnknownDaemon(TightloopError, LookupError):
    """No daemon of that name is running; the message lists those that are."""


class ProtocolMismatch(TightloopError, RuntimeError):
    """Client and daemon are of different versions; the message names both."""


class TransportError(TightloopError, OSError):
    """The shared-memory transport failed; the message holds its reason."""


class LeaseHeld(TightloopError, RuntimeError):
    """Another client controls the daemon; the message names its process."""


class LeaseLost(TightloopError, RuntimeError):
    """This client controlled the daemon and no longer does, since it did not answer for too long."""


class DaemonLost(TightloopError, ConnectionError):
    """The daemon ended or was killed; its state is lost. Frames already received stay valid."""


class DaemonRestarted(DaemonLost):
    """A daemon of the same name runs, but not the one that this client knew; its state is lost."""


class SimClosed(TightloopError, RuntimeError):
    """The simulation was closed; frames already received stay valid."""


class CommandRefused(TightloopError, ValueError):
    """A command has a wrong shape, dtype or value; the message names field, world and dof. The daemon goes on."""


class ConstantParameter(CommandRefused, AttributeError):
    """A parameter is a constant of this run; the message says how to let it vary."""


class SnapshotError(TightloopError, ValueError):
    """A snapshot is damaged, of something else, or cannot be written; the message says which. No world was changed."""


class RecordingError(TightloopError, ValueError):
    """A recording cannot be read, or not further, or the files of its scene are not what they were."""


class UnknownField(TightloopError, AttributeError):
    """Frames of this run do not carry that field; ask for it in ``fields`` at launch."""


class FramesHeld(TightloopError, RuntimeError):
    """Too many frames are alive at once: use ``frame.copy()``, or launch with a larger ``frames_held``."""


class WaitTimeout(TightloopError, TimeoutError):
    """The daemon is alive but did not answer in time."""
