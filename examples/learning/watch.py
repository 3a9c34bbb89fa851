"""What likely goes wrong in a training, and is said while it runs or at its end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from evaluation import UNITS

RATIO, SECONDS = 10.0, 60.0  # of a term to all others together, and how long
BETTER = 0.9  # an error that was learnt to be small is at most this share of the first
PREFIX = "train/return/"  # of the sums of reward terms in the log


class TermWatch:
    """Watches whether one term of the reward outweighs all others."""

    def __init__(self) -> None:
        self._since: dict[str, float] = {}
        self._known: set[str] = set()

    def see(self, news: Mapping[str, float], seconds: float) -> str | None:
        """Return a warning, once per term that was ten times all others together for a minute.

        Args:
            news: Means of a rollout, by name in the log.
            seconds: Time since the start of the run.
        """
        sums = {name.removeprefix(PREFIX): abs(mean) for name, mean in news.items() if name.startswith(PREFIX)}
        if not sums:
            return None
        largest = max(sums, key=lambda name: sums[name])
        rest = sum(sums.values()) - sums[largest]
        if len(sums) < 2 or sums[largest] <= RATIO * rest:
            self._since.clear()
            return None
        begun = self._since.setdefault(largest, seconds)
        self._since = {largest: begun}
        if seconds - begun < SECONDS or largest in self._known:
            return None
        self._known.add(largest)
        return (
            f"the reward's term {largest!r} has outweighed all others {sums[largest] / max(rest, 1e-12):.0f} times for "
            f"{SECONDS:.0f} s, so that the policy learns little else; change its weight in `reward_weights`"
        )


def nothing_learnt(curve: Sequence[Mapping[str, float]]) -> str | None:
    """Return a warning if the last evaluation is no better than the first; None otherwise.

    It compares the success, and errors such as the distance from a goal; the return of tasks that have neither.

    Args:
        curve: Evaluations, the first one of the policy before it learnt.
    """
    if len(curve) < 2:
        return None
    first, last = curve[0], curve[-1]
    errors = [name for name in UNITS if name in first and name in last]
    if any(last[name] <= BETTER * first[name] for name in errors) or last.get("success", 0) > first.get("success", 0):
        return None
    if errors or "success" in last:
        names = [*errors, *(["success"] if "success" in last else [])]
    elif last["return"] > first["return"]:
        return None
    else:
        names = ["return"]
    told = ", ".join(f"{name} {last[name]:.3g} ({first[name]:.3g} at the start)" for name in names)
    return (
        f"nothing was learnt: {told}; look at the terms of the reward in the log, the effort limits of the drives, and "
        "whether actions reach what the task asks for"
    )
