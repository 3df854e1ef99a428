"""``mocobot compare``: two results side by side, and what differs by more than its errors."""

from contextlib import nullcontext
from dataclasses import asdict

from estimator.files import whole_folder
from mocobot.api.comparison import compare
from mocobot.comparison.text import what_changed, write_into
from mocobot.files.provenance import provenance
from mocobot.options import Compare
from mocobot.strict import NotGood


def run(options: Compare) -> None:
    """Run the command.

    Raises:
        InputError: a result cannot be read, they are of different kinds, or the output cannot be written.
        NotGood: with ``strict``, something changed.
    """
    found = compare(options.a, options.b)
    with whole_folder(options.out, "comparison") if options.out else nullcontext() as folder:
        if folder is not None:
            inputs = [path for path in (options.a, options.b) if path.is_file()]
            write_into(folder, found, provenance("compare", asdict(options), inputs))
    print(found)
    if options.out:
        print(f"\nWritten to {options.out}.")
    if options.strict and found.changed:
        raise NotGood(f"they differ: {what_changed(found) or found.changes[0].rstrip('.')}")
