"""The method of a scene that adds cameras."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

from tightloop.checks.arguments import Vector
from tightloop.checks.attributes import Attributes
from tightloop.checks.signatures import checked_calls
from tightloop.scene.body import Body
from tightloop.scene.cameras import make_camera
from tightloop.scene.cameras.camera import Camera, Sees
from tightloop.scene.robot import Link
from tightloop.scene.shapes import ORIGIN

if TYPE_CHECKING:
    from tightloop.scene.parts import Parts


@checked_calls
class CameraMethods(Attributes):
    """Cameras of a `Scene`."""

    __slots__ = ()

    def add_camera(
        self,
        *,
        width: int | None = None,
        height: int | None = None,
        fov: float | None = None,
        body: Body | Link | str | None = None,
        pos: Vector = ORIGIN,
        quat: Vector | None = None,
        target: Vector | None = None,
        focal: Vector | None = None,
        center: Vector | None = None,
        near: float = 0.01,
        far: float = 10.0,
        every: int = 1,
        worlds: Sequence[int] | None = None,
        sees: Sees = "visuals",
        depth_noise: Vector = (0.0, 0.0),
        mujoco: str | None = None,
        name: str | None = None,
    ) -> Camera:
        """Add a camera, whose images are fields of frames: depths, labels and colours, in every world.

        Its frame has x to the right of the image, y down and z forward. A ray goes through the middle of each pixel.
        Depths are measured along z, as by depth cameras, and not along the ray. Images show the state of their frame.
        They cost nothing where ``launch(fields=...)`` does not ask for them.

        >>> wrist = scene.add_camera(body=arm.link("fr3_hand"), pos=(0.05, 0, 0), width=64, height=64, name="wrist")
        >>> with tl.launch(scene, worlds=1024, fields=("joint_q", wrist.depth)) as sim:
        ...     frame = sim.reset()
        ...     frame.wrist_depth  # (1024, 64, 64), a view of shared memory

        Args:
            width: Pixels of a row, 1 to 4096.
            height: Rows, 1 to 4096.
            fov: Vertical field of view [rad], 0.001 to 3.1; 45° if left out, as in MuJoCo.
            body: Body that carries the camera, a robot's link (``robot.link("hand")``), or the name of either; links of
                a MuJoCo model as ``"model/body"``. None for a camera that is fixed in the world.
            pos: Position in the frame of the body [m].
            quat: Orientation in that frame (x, y, z, w); z of the camera is z of the frame if left out.
            target: Point in the frame of the body that the camera looks at, instead of ``quat`` [m]. The frame's z axis
                is up in the image.
            focal: Measured focal lengths along x and y, instead of ``fov`` [pixels].
            center: Principal point with ``focal``, from the upper left corner [pixels]; the middle if left out.
            near: Nearest depth that is seen [m], at least 1e-6.
            far: Farthest depth that is seen [m], at most 1e6.
            every: Control frames from one image to the next. An image is drawn at each multiple of it in a world's
                ``step``, and frames repeat it in between.
            worlds: Numbers of the worlds that have images, such as ``range(4)``; all if left out. Images of the others
                are 0, labels too, and take no time. Numbers go on through groups. A launch needs these worlds.
            sees: What is seen of robots whose files have both: ``"visuals"`` or ``"collisions"``. Robots without any
                visuals are seen by their collision shapes.
            depth_noise: Standard deviation of depths, ``(a, b)``: a + b z² of a depth z [m, 1/m]. Each pixel of each
                frame has a draw of its own. The sum stays between ``near`` and ``far``.
            mujoco: A camera of a MuJoCo model, ``"model/camera"``: this one has its body, place and lens, and its
                resolution if ``width`` and ``height`` are left out.
            name: Unique name, a Python identifier of 19 letters at most; ``camera``, ``camera_2``, … if left out.

        Returns:
            The camera, which has the names of its fields: ``camera.depth``, ``camera.segmentation`` and
            ``camera.rgb``.

        Raises:
            SceneError: A value is out of range, or the body does not exist; the message names it.
        """
        return make_camera.add_camera(
            cast("Parts", self),
            name=name,
            mujoco=mujoco,
            body=body,
            pos=pos,
            quat=quat,
            target=target,
            width=width,
            height=height,
            fov=fov,
            focal=focal,
            center=center,
            near=near,
            far=far,
            every=every,
            worlds=worlds,
            sees=sees,
            depth_noise=depth_noise,
        )
