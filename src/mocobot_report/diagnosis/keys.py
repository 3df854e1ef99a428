"""What a diagnosis' plots compare."""

from mocobot_report.blocks.legend import Key

CLEAN = Key("", "clean data", "text", "dash")


def misfits(*, named: bool, lines: bool = False) -> tuple[Key, Key]:
    """The misfit as simulated, and that within tolerances with the causes that are named, if any; dots or lines."""
    after = "with causes and tolerances" if named else "with tolerances"
    square, circle = ("line", "line") if lines else ("square", "circle")
    return Key("before", "as simulated", "before", square), Key("after", after, "after", circle)
