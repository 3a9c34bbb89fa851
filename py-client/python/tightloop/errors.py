"""Every exception tightloop raises on its own account; each says what is wrong and what to do.

All derive from `TightloopError`. Where Python has a word for the mistake (`ValueError`, `TimeoutError`, …)
the exception derives from that too, so that ordinary `except` clauses work.
"""

from __future__ import annotations


class TightloopError(Exception):
    """Base of all exceptions of this package."""


class SceneError(TightloopError, ValueError):
    """A scene, or a value written into one, is not valid. The message names the part and the cure."""


class UrdfError(SceneError):
    """A URDF file cannot be read, or describes a robot that cannot be simulated."""


class LaunchError(TightloopError, RuntimeError):
    """The daemon could not be started; the message holds its reason."""


class ResourceError(LaunchError):
    """There is not enough memory, or not enough room in shared memory, for that many worlds."""


class UnknownDaemon(LaunchError):
    """No daemon of that name is running."""


class ProtocolMismatch(TightloopError, RuntimeError):
    """Client and daemon are of different versions; the message names both."""


class LeaseHeld(TightloopError, RuntimeError):
    """Another client controls the daemon; the message names its process."""


class LeaseLost(TightloopError, RuntimeError):
    """This client controlled the daemon and no longer does: its heartbeat was missed, or it was closed."""


class DaemonLost(TightloopError, ConnectionError):
    """The daemon ended or was killed; its state is lost. Frames already received stay valid."""


class DaemonRestarted(DaemonLost):
    """A daemon of the same name runs again, but not the one this client knew; its state is lost."""


class CommandRefused(TightloopError, ValueError):
    """A command has the wrong shape, dtype or value; the message names field, world and dof. The daemon goes on."""


class FramesHeld(TightloopError, RuntimeError):
    """Too many frames are alive at once: use ``frame.copy()``, or launch with a larger ``frames_held``."""


class WaitTimeout(TightloopError, TimeoutError):
    """The daemon is alive but did not answer in time."""


class InternalError(TightloopError, RuntimeError):
    """A bug in tightloop; please report it with the message."""
