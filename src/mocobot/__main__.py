"""``python -m mocobot``."""

from mocobot.cli import main

main()
