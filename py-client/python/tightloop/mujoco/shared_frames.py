"""Frames that MuJoCo takes from the body.

MuJoCo's compiler marks a geom, a site or an inertial frame that has the pose or the orientation of its body, or of the
body's inertia, up to 1e-6 or so. Kinematics then copies that frame (``mjtSameFrame``), and the element's own numbers,
which differ from it by less than that, are not used.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_IDENTITY = (1.0, 0.0, 0.0, 0.0)


def apply(model: Any, arrays: dict[str, NDArray[Any]]) -> None:
    """Replace the poses in the arrays of a model by those that MuJoCo's kinematics uses."""
    import mujoco

    kinds = mujoco.mjtSameFrame
    both = {"body": int(kinds.mjSAMEFRAME_BODY), "inertia": int(kinds.mjSAMEFRAME_INERTIA)}
    turns = {"body": int(kinds.mjSAMEFRAME_BODYROT), "inertia": int(kinds.mjSAMEFRAME_INERTIAROT)}
    for of, pos, quat in (
        ("body", "body_ipos", "body_iquat"),
        ("geom", "geom_pos", "geom_quat"),
        ("site", "site_pos", "site_quat"),
    ):
        same = np.asarray(getattr(model, f"{of}_sameframe")).astype(int)
        body = np.arange(model.nbody) if of == "body" else arrays[f"{of}_bodyid"]
        in_body = same == both["body"]
        arrays[pos][in_body] = 0
        arrays[quat][in_body | (same == turns["body"])] = _IDENTITY
        if of != "body":
            in_inertia = same == both["inertia"]
            arrays[pos][in_inertia] = arrays["body_ipos"][body[in_inertia]]
            turned = in_inertia | (same == turns["inertia"])
            arrays[quat][turned] = arrays["body_iquat"][body[turned]]
