"""Do the robots contradict each other beyond noise? In one sentence."""

from collections.abc import Sequence

from estimator.leftover.leftover import Leftover

CONTRADICTS = 3.0
"""Left over, in what noise and rounding leave, beyond which the robots contradict each other. Measured: docs/method.md,
'Do the robots contradict each other?'."""
_WORDS = {
    "flange_position": ("flanges miss their grasps by", 1e3, "mm"),
    "flange_rotation": ("are turned off them by", 1e3, "mrad"),
    "force": ("forces do not add up by", 1.0, "N"),
    "moment": ("moments by", 1.0, "N m"),
}
"""What is said of each quantity, and the unit it is said in."""


def beyond_noise(leftovers: Sequence[Leftover]) -> list[Leftover]:
    """Those that noise does not explain."""
    return [one for one in leftovers if one.ratio > CONTRADICTS]


def contradiction(found: Sequence[tuple[str, Sequence[Leftover]]]) -> str | None:
    """The sentence, from recordings' names and what each leaves over; None where all is noise."""
    bad = [(name, wrong) for name, leftovers in found if (wrong := beyond_noise(leftovers))]
    if not bad:
        return None
    name, worst = max(bad, key=lambda entry: max(one.ratio for one in entry[1]))
    where = name if len(bad) == 1 else f"in {len(bad)} of {len(found)} recordings, most in {name}"
    team = any(one.name.startswith("flange") for _, leftovers in found for one in leftovers)
    moving = any(one.name.startswith("flange") for _, wrong in bad for one in wrong)
    what = (
        "Arms that differ from their design (encoder zeros, lengths, springs) do this"
        if moving or not team
        else "The flanges agree and the wrenches do not: springs or torque zeros are off, or another robot carries, "
        "too, and these are not the payload's numbers"
    )
    return (
        f"The robot{'s contradict each other' if team else ' contradicts itself'} beyond noise ({where}): "
        f"{', '.join(map(_words, worst))}. Standard errors do not cover this: values may be off by many of them. "
        f"{what}: calibrate the arms; mocobot diagnose says what else is wrong."
    )


def _words(one: Leftover) -> str:
    what, scale, unit = _WORDS[one.name]
    return f"{what} {scale * one.left:.2g} {unit} rms ({one.ratio:.2g} times noise)"
