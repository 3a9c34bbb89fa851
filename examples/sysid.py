"""System identification: masses, inertias and a centre of mass of an arm with a tool, from its recorded motion.

    python examples/sysid.py

The encoders of an arm have recorded how it followed targets. Its links and its tool differ from their data sheet by
tens of percent. Gauss-Newton finds the parameters θ whose simulated motion q(θ) is the recorded one:

    min ‖q(θ) - recorded‖² / σ² + ‖θ‖²          θ is in standard deviations of the data sheet, σ is the encoders' noise
    δθ = -(H + λ)⁻¹ (Jᵀ (q - recorded) / σ² + θ)      H = JᵀJ / σ² + 1,  J = ∂q/∂θ

All differences of one iteration are worlds of one rollout: parameters differ per world. H⁻¹ is the covariance of what
is found. Motion says nothing of some parameters, such as the mass of the first link. They stay as the data sheet has
them.

A centre of mass does not differ per world. So the tool consists of four weights on fixed links, whose masses do: they
give mass and centre of mass. The inertia of the first weight adds what is missing.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

import tightloop as tl
from tightloop import assets

Array = NDArray[np.float64]

# Gains of a compliant joint impedance controller, as in examples of libfranka [N·m/rad, N·m·s/rad]
STIFFNESS, DAMPING = [600.0, 600, 600, 600, 250, 150, 50, 100, 100], [50.0, 50, 50, 50, 30, 25, 15, 10, 10]
MIDDLE = np.array([0.0, -0.8, 0.0, -2.2, 0.0, 1.9, 0.8, 0.02, 0.02])  # of the motion [rad, m]
FRAMES, RATE = 600, 60  # of a motion [–, 1/s]
SIGMA = 1e-4  # noise of the encoders [rad]
CORNERS = 0.06 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) + [0, 0, 0.06]  # of the weights [m]
LINKS = [f"arm/fr3_link{number}" for number in range(1, 8)]
WEIGHTS = [f"arm/weight{number}" for number in range(4)]
PARAMS = ("body_mass", "body_inertia")
PRIOR = 0.2  # standard deviation of masses and inertias over what the data sheet says [–]
DIFFERENCE = 1e-3  # of θ
ITERATIONS = 20
DAMPINGS = [0.0, *np.geomspace(1.0, 1e6, 7)]  # that steps are tried with
IDENTIFIED = 0.3  # a value is identified where motion leaves at most this part of its standard deviation


def scene(folder: Path) -> tl.Scene:
    """Return the arm with its tool as the data sheet has them; the URDF file with the tool goes to a folder."""
    robot = ElementTree.parse(assets.FR3).getroot()
    for link in robot.iter("link"):
        for part in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(part)  # shapes play no role here
    for number, corner in enumerate(CORNERS):
        joint = ElementTree.SubElement(robot, "joint", name=f"weight{number}_joint", type="fixed")
        ElementTree.SubElement(joint, "parent", link="fr3_hand_tcp")
        ElementTree.SubElement(joint, "child", link=f"weight{number}")
        ElementTree.SubElement(joint, "origin", xyz=" ".join(map(str, corner)))
        inertial = ElementTree.SubElement(ElementTree.SubElement(robot, "link", name=f"weight{number}"), "inertial")
        ElementTree.SubElement(inertial, "mass", value="0.3")
        own = {"ixx": 2e-3, "iyy": 2e-3, "izz": 2e-3, "ixy": 0, "ixz": 0, "iyz": 0} if number == 0 else {}
        small = dict.fromkeys(("ixx", "iyy", "izz"), 1e-6) | dict.fromkeys(("ixy", "ixz", "iyz"), 0)
        ElementTree.SubElement(inertial, "inertia", {name: str(value) for name, value in (small | own).items()})
    file = folder / "arm.urdf"
    ElementTree.ElementTree(robot).write(file)
    made = tl.Scene(dt=1 / (8 * RATE), substeps=8)
    arm = made.add_urdf(file, name="arm")
    arm.joint_q, arm.joint_target_ke, arm.joint_target_kd = MIDDLE, STIFFNESS, DAMPING
    return made


def excitation(seed: int) -> Array:
    """Return random targets that excite all joints [rad, m], ``(frames, dofs)``; they begin in the middle."""
    rng, time = np.random.default_rng(seed), np.arange(1, FRAMES + 1)[:, None] / RATE
    targets = np.tile(MIDDLE, (FRAMES, 1))
    for frequency in (0.3, 0.7, 1.1):  # [1/s]
        size = np.minimum(time, 1.0) * rng.uniform(-1, 1, 7) * 0.12 / frequency
        targets[:, :7] += size * np.sin(2 * np.pi * frequency * time)
    return targets


class Model:
    """What the arm does with parameters θ: masses of links and weights, and inertias of links and of the first weight.

    Args:
        sim: A simulation of the scene with `worlds` worlds, whose `PARAMS` vary.

    Attributes:
        worlds: Number of worlds of one iteration: the present θ, and each parameter to both sides.
        at: Index of each link and weight.
        names: Parameter and place of each entry of θ.
        start: What the data sheet says of it [kg, kg·m²], ``(parameters,)``.
        prior: How uncertain that is, likewise.
    """

    worlds = 1 + 2 * (len(LINKS + WEIGHTS) + 6 * len([*LINKS, WEIGHTS[0]]))

    def __init__(self, sim: tl.Sim) -> None:
        self._sim, self._sheet = sim, {name: np.array(getattr(sim.params, name)[0]) for name in PARAMS}
        self.at = at = {name: sim.body_names.index(name) for name in LINKS + WEIGHTS}
        self.names: list[tuple[str, tuple[int, ...]]] = [("body_mass", (at[name],)) for name in at]
        self.names += [("body_inertia", (at[name], entry)) for name in [*LINKS, WEIGHTS[0]] for entry in range(6)]
        xx, yy, zz = self._sheet["body_inertia"].T[:3]
        scales = {
            "body_mass": self._sheet["body_mass"],
            "body_inertia": np.sqrt([xx * xx, yy * yy, zz * zz, xx * yy, xx * zz, yy * zz]).T,
        }
        self.start = np.array([self._sheet[name][place] for name, place in self.names])
        self.prior = PRIOR * np.array([scales[name][place] for name, place in self.names])

    def params(self, theta: Array) -> dict[str, Array]:
        """Return `Sim.params` for θ ``(worlds, parameters)``."""
        found = {name: np.tile(sheet, (len(theta), *[1] * sheet.ndim)) for name, sheet in self._sheet.items()}
        for number, (name, place) in enumerate(self.names):
            found[name][(slice(None), *place)] = self.start[number] + self.prior[number] * theta[:, number]
        return found

    def motion(self, theta: Array, targets: Array) -> Array:
        """Return the motion of the joints for each θ [rad], ``(len(theta), frames, joints)``."""
        worlds = np.minimum(np.arange(self._sim.worlds), len(theta) - 1)  # those to spare repeat the last
        self._sim.reset()
        self._sim.params.write(**self.params(theta[worlds]))
        moved = self._sim.rollout({"joint_target_q": targets}, fields=("joint_q",))
        moved.joint_q[:, moved.faulted] = np.inf
        return np.array(moved.joint_q[:, : len(theta), :7]).swapaxes(0, 1)

    def linearized(self, theta: Array, targets: Array) -> tuple[Array, Array]:
        """Return the motion for θ, ``(values,)``, and its Jacobian, ``(values, parameters)``, by one rollout."""
        by = DIFFERENCE * np.eye(len(theta))
        here, *sides = self.motion(np.concatenate((theta[None], theta + by, theta - by)), targets)
        ahead, behind = np.reshape(sides, (2, len(theta), -1))
        return here.ravel(), (ahead - behind).T / (2 * DIFFERENCE)


class Found(NamedTuple):
    """What `identify` found."""

    theta: Array
    """The parameters, ``(parameters,)``."""
    covariance: Array
    """Their covariance, ``(parameters, parameters)``."""
    rms: list[float]
    """Root mean square of the residuals before each iteration [rad]."""


def identify(model: Model, targets: Array, recorded: Array) -> Found:
    """Find the parameters of a recorded motion, ``(frames, joints)``, by Gauss-Newton from the data sheet.

    Steps with several dampings are worlds of one rollout, too. The search ends when the objective falls by less than
    0.1. That is little: noise makes the objective of the true parameters vary by √(2 values).
    """

    def objective(moved: Array, theta: Array) -> Array:
        return np.square((moved - recorded) / SIGMA).sum(axis=(1, 2)) + np.square(theta).sum(axis=1)

    theta, rms = np.zeros(len(model.names)), []
    for _ in range(ITERATIONS):
        simulated, jacobian = model.linearized(theta, targets)
        off = simulated - recorded.ravel()
        rms.append(float(np.sqrt(np.mean(np.square(off)))))
        information = jacobian.T @ jacobian / SIGMA**2 + np.eye(len(theta))
        slope = jacobian.T @ off / SIGMA**2 + theta
        steps = [np.linalg.solve(information + damping * np.eye(len(theta)), slope) for damping in DAMPINGS]
        tried = np.array([theta, *(theta - step for step in steps)])
        tried = tried[(model.params(tried)["body_mass"] >= 0).all(axis=1)]
        values = objective(model.motion(tried, targets), tried)
        if values.min() > values[0] - 0.1:
            return Found(theta, np.linalg.inv(information), rms)
        theta = tried[values.argmin()]
    raise SystemExit(f"no convergence in {ITERATIONS} iterations: residuals {rms} rad; choose a smaller prior")


def symmetric(parts: Array) -> Array:
    """Return the matrix of xx, yy, zz, xy, xz, yz."""
    return parts[[[0, 3, 4], [3, 1, 5], [4, 5, 2]]]


def quantities(model: Model, theta: Array) -> Array:
    """Return what the table shows of θ: masses of links, then mass, centre of mass and inertia of the tool."""
    of = {name: values[0] for name, values in model.params(theta[None]).items()}
    weights = [model.at[name] for name in WEIGHTS]
    masses = of["body_mass"][weights]
    com = masses @ CORNERS / masses.sum()
    arms = CORNERS - com
    inertia = symmetric(of["body_inertia"][weights].sum(axis=0))
    inertia += np.einsum(
        "w,wij->ij", masses, np.square(arms).sum(axis=1)[:, None, None] * np.eye(3) - arms[:, :, None] * arms[:, None]
    )
    about = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return np.array([*of["body_mass"][[model.at[name] for name in LINKS]], masses.sum(), *com, *about])


ROWS = [f"mass of {name.removeprefix('arm/')} [kg]" for name in LINKS] + ["mass of the tool [kg]"]
ROWS += [f"its centre of mass, {axis} [m]" for axis in "xyz"]
ROWS += [f"its inertia {axes} [kg·m²]" for axes in ("xx", "yy", "zz", "xy", "xz", "yz")]


def table(model: Model, true: Array, found: Found) -> str:
    """Return what was found beside the truth, and which rows the motion identifies."""
    lines = [f"{'':<28}{'data sheet':>12}{'true':>10}{'found':>10}{'±':>10}"]
    by = DIFFERENCE * np.eye(len(true))

    def std(theta: Array, covariance: Array) -> Array:
        slopes = [quantities(model, theta + one) - quantities(model, theta - one) for one in by]
        slope = np.array(slopes).T / (2 * DIFFERENCE)
        return np.sqrt(np.diag(slope @ covariance @ slope.T))

    sides = [quantities(model, theta) for theta in (np.zeros(len(true)), true, found.theta)]
    known = std(found.theta, found.covariance) / std(np.zeros(len(true)), np.eye(len(true)))
    rows = zip(ROWS, *sides, std(found.theta, found.covariance), known < IDENTIFIED, strict=True)
    for name, sheet, truth, value, error, identified in rows:
        mark = "" if identified else "  not identified"
        lines.append(f"{name:<28}{sheet:>12.4f}{truth:>10.4f}{value:>10.4f}{error:>10.4f}{mark}")
    return "\n".join(lines)


def truth(model: Model, rng: np.random.Generator) -> Array:
    """Draw θ of an arm that can be: an inertia has positive moments, none above the sum of the others."""
    theta = rng.normal(size=len(model.names))
    inertias = np.array([name == "body_inertia" for name, _ in model.names])
    for first in np.flatnonzero(inertias)[::6]:
        own = slice(first, first + 6)
        while True:
            moments = np.linalg.eigvalsh(symmetric(model.start[own] + model.prior[own] * theta[own]))
            if moments[0] > 0 and moments[2] <= moments[0] + moments[1]:
                break
            theta[own] = rng.normal(size=6)
    return theta


def main() -> None:
    """Record a motion, identify the parameters, and predict another motion."""
    parser = argparse.ArgumentParser(description="System identification of an arm with a tool.")
    parser.add_argument("--seed", type=int, default=0, help="of the true parameters, the motion and the noise")
    seed = parser.parse_args().seed
    # motion leaves some inertias open, and steps may lead through what no body has
    warnings.filterwarnings("ignore", ".*which no body has", tl.TightloopWarning)
    rng = np.random.default_rng(seed)
    with (
        tempfile.TemporaryDirectory() as folder,
        tl.launch(scene(Path(folder)), worlds=Model.worlds, precision="f64", params=PARAMS, fields=("joint_q",)) as sim,
    ):
        model = Model(sim)
        true = truth(model, rng)
        targets, others = excitation(2 * seed), excitation(2 * seed + 1)
        recorded, new = (model.motion(true[None], one)[0] for one in (targets, others))
        found = identify(model, targets, recorded + rng.normal(0, SIGMA, recorded.shape))
        print(table(model, true, found))
        directions = np.linalg.eigvalsh(found.covariance) < IDENTIFIED**2
        print(f"{directions.sum()} combinations of {len(true)} parameters are identified")
        predicted, jacobian = model.linearized(found.theta, others)
        expected = np.sqrt(np.einsum("ij,jk,ik->", jacobian, found.covariance, jacobian) / len(predicted))
        sheet = model.motion(np.zeros_like(true)[None], others)
        errors = [1e3 * np.sqrt(np.mean(np.square(one.ravel() - new.ravel()))) for one in (sheet, predicted)]
        print(f"residuals of the iterations: {', '.join(f'{1e3 * one:.3f}' for one in found.rms)} mrad")
        print(f"a new motion is off by {errors[0]:.3f} mrad by the data sheet, by {errors[1]:.3f} mrad as identified")
        print(f"{1e3 * expected:.3f} mrad are expected from the noise of {1e3 * SIGMA:.1f} mrad")


if __name__ == "__main__":
    main()
