"""Colours of MuJoCo's textures."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def means(model: Any) -> NDArray[np.float64]:
    """Return the mean colour of each material's texture: what MuJoCo multiplies the material's colour with.

    Args:
        model: An ``MjModel``.

    Returns:
        Red, green and blue, 0 to 1, shape ``(materials, 3)``; 1 where a material has no texture.
    """
    import mujoco

    roles = [int(role) for role in (mujoco.mjtTextureRole.mjTEXROLE_RGB, mujoco.mjtTextureRole.mjTEXROLE_RGBA)]
    found = np.ones((model.nmat, 3))
    for material, used in enumerate(np.asarray(model.mat_texid)):
        texture = next((int(used[role]) for role in roles if used[role] >= 0), None)
        if texture is not None:
            found[material] = _mean(model, texture)
    return found


def _mean(model: Any, texture: int) -> NDArray[np.float64]:
    channels = int(model.tex_nchannel[texture])
    first = int(model.tex_adr[texture])
    texels = int(model.tex_height[texture]) * int(model.tex_width[texture])
    data = np.asarray(model.tex_data[first : first + texels * channels]).reshape(texels, channels)
    # fewer than three channels are a grey, perhaps with an opacity
    return data[:, :3].mean(axis=0) / 255 if channels >= 3 else np.full(3, data[:, 0].mean() / 255)
