"""MuJoCo models that every supported version compiles, and models with parts that tightloop refuses."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

CART = Path(__file__).parents[3] / "examples/assets/cart/cart.xml"

#: All kinds of joints, activations, tendons, equalities, a mocap body, keyframes and sensors; nothing touches.
MACHINE = """
<mujoco model="machine">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="0.002" integrator="{integrator}" tolerance="0" iterations="100" ls_iterations="100"
    ls_tolerance="0" density="1.2" viscosity="0.01" wind="0.3 0 0.1"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <site name="origin" pos="0.1 0.2 0.3" euler="0.1 0.2 0.3"/>
    <body name="target" mocap="true" pos="0.4 0 1.5"/>
    <body name="rail" pos="0 0 1">
      <joint name="slide" type="slide" axis="1 0.2 0" damping="0.4" range="-0.3 0.3" frictionloss="0.2"/>
      <geom type="box" size="0.1 0.05 0.05" mass="1"/>
      <body name="arm" pos="0 0 0.1" gravcomp="0.5">
        <joint name="hinge" axis="0 1 0" ref="0.1" armature="0.02" stiffness="3" springref="0.2" range="-0.6 0.8"
          actuatorfrcrange="{range}"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0.05 0 0.5" mass="0.4"/>
        <site name="tip" pos="0.05 0 0.5" euler="0.2 0.1 0.4"/>
        <body name="hand" pos="0.05 0 0.5">
          <joint name="ball" type="ball" damping="0.05" stiffness="0.3" range="0 0.9"/>
          <geom name="hand" type="box" size="0.06 0.03 0.02" pos="0.06 0.01 0" mass="0.2"/>
          <site name="hand" pos="0.1 0 0" euler="0 0.5 0"/>
          <body name="finger" pos="0.12 0 0">
            <joint name="finger" axis="0 0 1" damping="0.02"/>
            <joint name="twist" axis="1 0 0" damping="0.02"/>
            <geom type="sphere" size="0.02" pos="0.03 0 0" mass="0.05"/>
          </body>
        </body>
      </body>
    </body>
    <body name="drone" pos="0.4 0 1.4">
      <freejoint name="free"/>
      <geom type="ellipsoid" size="0.1 0.06 0.03" pos="0.02 0 0.01" mass="0.5"/>
      <site name="engine" pos="0 0.05 0.02"/>
      <camera name="eye" pos="0 0 0.1"/>
    </body>
    <body name="left" pos="-0.6 0 1"><joint name="left" axis="0 1 0" damping="0.1"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0" mass="0.3"/></body>
    <body name="right" pos="-0.6 0.3 1"><joint name="right" axis="0 1 0" damping="0.1"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0" mass="0.3"/></body>
    <body name="hung" pos="-1.2 0 1"><joint name="hung" axis="0 1 0"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0" mass="0.3"/>
      <body name="link" pos="0.3 0 0"><joint name="link" axis="0 1 0"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0" mass="0.2"/></body></body>
  </worldbody>
  <tendon>
    <fixed name="sum" stiffness="2" damping="0.1" frictionloss="0.05" range="-0.4 0.5">
      <joint joint="slide" coef="0.5"/><joint joint="hinge" coef="-1.2"/></fixed>
    <fixed name="first"><joint joint="finger" coef="1"/></fixed>
    <fixed name="second"><joint joint="twist" coef="-0.7"/></fixed>
  </tendon>
  <equality>
    <weld name="hold" body1="target" body2="drone" torquescale="0.6" solref="0.05 1"/>
    <connect name="pin" body1="link" anchor="0.3 0 0"/>
    <joint name="gear" joint1="right" joint2="left" polycoef="0.1 -0.8 0.2 0 0"/>
    <tendon name="cable" tendon1="first" tendon2="second" polycoef="0 0.9 0 0 0"/>
  </equality>
  <actuator>
    <motor name="push" joint="slide" gear="8" ctrlrange="-1 1"/>
    <position name="turn" joint="hinge" kp="6" kv="0.4" forcerange="-3 3"/>
    <general name="slow" joint="finger" dyntype="filter" dynprm="0.03" gainprm="0.4"/>
    <general name="exact" joint="twist" dyntype="filterexact" dynprm="0.02" gainprm="0.2" actearly="true"/>
    <intvelocity name="winch" joint="left" kp="2" actrange="-0.5 0.5"/>
    <motor name="pull" tendon="sum" gear="0.5"/>
    <motor name="spin" joint="ball" gear="0.1 0 0.05"/>
    <motor name="thrust" site="engine" gear="0 0 3 0.1 0 0"/>
  </actuator>
  <sensor>
    <jointpos joint="hinge"/><jointvel joint="slide"/><jointactuatorfrc joint="hinge"/>
    <jointlimitpos joint="slide"/><jointlimitfrc joint="slide"/>
    <ballquat joint="ball"/><ballangvel joint="ball"/>
    <tendonpos tendon="sum"/><tendonvel tendon="sum"/><tendonactuatorfrc tendon="sum"/><tendonlimitpos tendon="sum"/>
    <actuatorpos actuator="turn"/><actuatorvel actuator="turn"/><actuatorfrc name="torque" actuator="turn" cutoff="1"/>
    <accelerometer site="hand"/><velocimeter site="hand"/><gyro site="hand"/><magnetometer site="hand"/>
    <force site="tip"/><torque site="tip"/>
    <framepos objtype="site" objname="hand" reftype="body" refname="drone"/>
    <framequat objtype="body" objname="drone"/><framexaxis objtype="geom" objname="hand"/>
    <framelinvel objtype="xbody" objname="drone" reftype="site" refname="origin"/>
    <frameangvel objtype="camera" objname="eye"/>
    <framelinacc objtype="site" objname="engine"/><frameangacc objtype="body" objname="hand"/>
    <subtreecom body="rail"/><subtreelinvel body="rail"/><subtreeangmom body="rail"/>
    <rangefinder site="origin"/><clock/><e_potential/><e_kinetic/>
  </sensor>
  <keyframe>
    <key name="start" time="0.5" qpos="0.28 0.3 0.9 0.1 0.2 0.3 0.1 -0.1 0.42 0.01 1.38 0.9 0.2 0 0.1 0.3 -0.1 0.2 -0.3"
      qvel="0.3 -0.2 0.1 0.2 0.3 0.4 -0.2 0.1 0 0.2 0.5 0.1 0.3 0.2 0.1 0.2 -0.1" act="0.2 -0.1 0.3"
      ctrl="0.2 0.4 0.1 0.1 0.2 0.3 0.1 0.5" mpos="0.45 0 1.45" mquat="0.98 0.1 0 0.1"/>
  </keyframe>
</mujoco>
"""

#: Geoms that touch: planes, spheres, capsules, a box on a plane, a pair of its own and an excluded one.
HEAP = """
<mujoco model="heap">
  <option timestep="0.002" cone="{cone}" impratio="2" tolerance="0" iterations="100" ls_iterations="100"
    ls_tolerance="0"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1" friction="0.8 0.01 0.001"/>
    <body name="ball" pos="0 0 0.099"><freejoint/><geom name="ball" size="0.1" mass="0.5" condim="6"/>
      <site name="skin" size="0.11"/></body>
    <body name="rod" pos="0.5 0 0.048" euler="0 85 10"><freejoint/>
      <geom name="rod" type="capsule" size="0.05 0.2" mass="0.7" condim="4" solref="0.03 0.8"
        solimp="0.8 0.9 0.01"/></body>
    <body name="box" pos="0 0.6 0.098" euler="1 2 5"><freejoint/>
      <geom name="box" type="box" size="0.2 0.15 0.1" mass="1.1"/></body>
    <body name="upper" pos="0.02 0.01 0.29"><freejoint/><geom name="upper" size="0.1" mass="0.3" margin="0.01"/></body>
    <body name="ghost" pos="0.05 0.1 0.1"><joint name="ghost" axis="0 1 0"/>
      <geom name="ghost" size="0.06" pos="0 0 0.2" mass="0.2"/></body>
  </worldbody>
  <contact>
    <pair name="pair" geom1="ball" geom2="upper" condim="3" friction="0.5 0.5 0.01 0.001 0.001"/>
    <exclude body1="ball" body2="ghost"/>
  </contact>
  <sensor>
    <touch name="touch" site="skin"/>
    <contact name="one" geom1="ball" geom2="floor" data="found force torque dist pos normal tangent" num="1"
      reduce="mindist"/>
    <contact name="net" body1="box" data="found force torque" reduce="netforce"/>
  </sensor>
</mujoco>
"""


#: Accelerometers on the world, on a body that is placed, and on one that moves.
AT_REST = """
<mujoco model="at-rest">
  <option tolerance="0" iterations="100" ls_iterations="100" ls_tolerance="0" gravity="0.5 0 -9.81"/>
  <worldbody>
    <site name="world" pos="0.1 0.2 0.3" euler="20 30 10"/>
    <body name="placed" mocap="true" pos="0 0 1"><site name="placed" euler="5 15 25"/></body>
    <body name="moved" pos="0 0 1"><joint axis="0 1 0"/><geom size=".1" pos=".1 0 0"/><site name="moved"/></body>
  </worldbody>
  <sensor>
    <accelerometer site="world"/><accelerometer site="placed"/><accelerometer site="moved"/>
    <framelinacc objtype="site" objname="world"/><framelinacc objtype="body" objname="placed"/>
    <frameangacc objtype="site" objname="world"/>
  </sensor>
</mujoco>
"""


@dataclass(frozen=True)
class Model:
    """A model, and how close tightloop comes to MuJoCo."""

    xml: str
    tolerance: float
    """Of accelerations, sensors and positions, relative to the largest value of the array."""
    frames: int
    """How many steps are compared."""
    before: tuple[int, int] = (99, 0)
    """First version of MuJoCo whose steps differ from ours."""
    note: str = ""
    """What tightloop notes about a model of that version."""


_OVERRIDE = """<option o_margin=".003" o_solref=".03 .8" o_solimp=".8 .9 .01 .5 2" o_friction=".4 .4 .02 .001 .001">
  <flag override="enable"/></option><worldbody>"""
_BELT = 'size="5 5 .1" surfacevel=".3 -.2 0 0 0 .5"'
_GLUE = 'size="5 5 .1" adhesion="2" gap=".01"'
# The machine's joint never reaches the first range and does reach the second.
WIDE, NARROW = "-200 200", "-2 2"
# Without contacts, rounding is what differs. Contacts amplify it by the stiffness of their rows.
MODELS = {
    "cart": Model(CART.read_text(), 1e-8, 200),
    "cart-rk4": Model(CART.read_text().replace("implicitfast", "RK4"), 1e-8, 200),
    "machine": Model(MACHINE.format(integrator="Euler", range=NARROW), 1e-8, 100),
    "machine-implicitfast": Model(MACHINE.format(integrator="implicitfast", range=WIDE), 1e-8, 100),
    "machine-implicit": Model(MACHINE.format(integrator="implicit", range=WIDE), 1e-8, 100),
    "machine-implicit-saturated": Model(
        MACHINE.format(integrator="implicit", range=NARROW),
        1e-8,
        100,
        before=(4, 0),
        note="implicit damps by actuators beyond `actuatorfrcrange`, as in MuJoCo 3.17",
    ),
    "machine-saturated": Model(
        MACHINE.format(integrator="implicitfast", range=NARROW),
        1e-8,
        100,
        before=(4, 0),
        note="implicitfast damps by actuators beyond `actuatorfrcrange`, as in MuJoCo 3.17",
    ),
    "machine-rk4": Model(
        MACHINE.format(integrator="RK4", range=NARROW),
        1e-8,
        50,
        before=(4, 0),
        note="RK4 turns ball and free joints as in MuJoCo 3.17, with second order",
    ),
    "at-rest": Model(AT_REST, 1e-8, 20),
    "heap": Model(HEAP.format(cone="pyramidal"), 1e-6, 40),
    "heap-elliptic": Model(HEAP.format(cone="elliptic"), 1e-6, 40),
    "heap-belt": Model(HEAP.format(cone="elliptic").replace('size="5 5 .1"', _BELT, 1), 1e-6, 40),
    "heap-sticky": Model(HEAP.format(cone="pyramidal").replace('size="5 5 .1"', _GLUE, 1), 1e-6, 40),
    "heap-override": Model(HEAP.format(cone="elliptic").replace("<worldbody>", _OVERRIDE, 1), 1e-6, 40),
}

_YIELDING = """<mujoco model="yielding">
  <option timestep=".002" integrator="{integrator}"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <site name="top" pos=".1 .1 1.6"/>
    <body pos="0 0 1">
      <joint name="hinge" axis="0 1 0" stiffness="9" springref="20" springyield="5" damping=".02"/>
      <geom size=".1" pos=".3 0 0"/><site name="arm" pos=".3 0 .1"/>
      <body pos=".5 0 0"><joint name="slide" type="slide" axis="1 0 0" stiffness="30 5 200" springyield=".02"/>
        <geom size=".08"/></body>
    </body>{more}
  </worldbody>
  <tendon>
    <fixed name="sum" stiffness="20" springlength="-.05 .05" springyield=".03">
      <joint joint="hinge" coef="1"/><joint joint="slide" coef="-2"/></fixed>
    <spatial name="rope" stiffness="20" springlength="0 .5" springyield=".02">
      <site site="top"/><site site="arm"/></spatial>
  </tendon>
  <keyframe><key name="fast" qvel="{speeds}"/></keyframe>
</mujoco>"""
_BALL = '<body pos="0 1 1"><joint type="ball" stiffness="3" springyield="4"/><geom size=".1" pos=".3 .05 0"/></body>'
#: Models that MuJoCo 4.0 was the first to compile.
NEWER = {
    "yielding": Model(_YIELDING.format(integrator="implicitfast", more=_BALL, speeds="-3 1 2 1 1"), 1e-8, 100),
    "yielding-rk4": Model(_YIELDING.format(integrator="RK4", more="", speeds="-3 1"), 1e-8, 100),
}

_SPRING = '<worldbody><body><joint name="j" axis="0 1 0" {}/><geom size=".1" pos=".3 0 0"/></body></worldbody>'
_FALL = (
    '<worldbody><geom type="plane" size="3 3 .1"/>'
    '<body pos="0 0 1"><freejoint/><geom name="g" size=".1"/>{}</body></worldbody>'
)
_MESH = '<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1" scale=".2 .2 .2"/></asset>'


@dataclass(frozen=True)
class Refused:
    """A model that some versions compile and tightloop refuses."""

    since: tuple[int, int]
    """First version of MuJoCo that compiles it."""
    xml: str
    message: str
    is_sensor: bool = False
    """Whether the model runs, and only a launch that asks for `sensordata` fails."""


REFUSED = {
    "adhesion": Refused(
        (3, 11),
        _FALL.format('<geom name="glue" size=".1" adhesion="-1"/>'),
        "geom `glue`: no support for a negative adhesion",
    ),
    "DC motors": Refused(
        (3, 11),
        _SPRING.format("")
        + '<actuator><dcmotor name="a" joint="j" motorconst="0.05" resistance="1" lugre="9 1 .1 .2 1"/></actuator>',
        "actuator `a`: no support for",
    ),
    "integrator": Refused(
        (3, 14), '<option integrator="discrete"/>' + _FALL.format(""), "no support for mjINT_DISCRETE"
    ),
    "PID": Refused(
        (3, 14),
        _SPRING.format("") + '<actuator><pid name="a" joint="j" kp="1"/></actuator>',
        "actuator `a`: no support for",
    ),
    "flag ipc": Refused(
        (3, 14),
        '<option integrator="discrete" solver="CG"><flag ipc="enable"/></option>' + _FALL.format(""),
        "mjENBL_IPC",
    ),
    "site of a mesh": Refused(
        (3, 14),
        _MESH + _FALL.format('<site name="s" type="mesh" mesh="m"/>') + '<sensor><touch name="t" site="s"/></sensor>',
        "sensor `t`: no support for sites of meshes",
        is_sensor=True,
    ),
    "plastic keyframe": Refused(
        (4, 0),
        _SPRING.format('stiffness="20" springyield="2"') + '<keyframe><key name="bent" plastic="1"/></keyframe>',
        "key `bent`: no support for rests of plastic springs",
    ),
    "flag speculative": Refused(
        (4, 0), '<option><flag speculative="enable"/></option>' + _FALL.format(""), "no support for mjENBL_SPECULATIVE"
    ),
}
