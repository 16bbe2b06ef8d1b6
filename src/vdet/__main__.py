"""Entry point of the program: nothing is imported from the current folder."""

import os
import sys


def main() -> None:
    """Run the program and exit: see `vdet.process.run`."""
    leave_out_current_folder()
    from vdet.process import run

    run()


def leave_out_current_folder() -> None:
    """Import nothing from the current folder, here and in child processes.

    `python -m vdet` puts it on the path of modules, and so does an empty entry of `PYTHONPATH`. A
    `queue.py` there would be run in place of Python's own. It stays where `PYTHONPATH` names it.
    Before this, only `os` and `sys` may be imported: Python itself has loaded them already.
    """
    named = [entry for entry in os.environ.get("PYTHONPATH", "").split(os.pathsep) if entry]
    os.environ["PYTHONPATH"] = os.pathsep.join(named)
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        here = os.getcwd()  # noqa: PTH109
    except OSError:  # it was removed
        return
    if here not in map(os.path.abspath, named):
        sys.path[:] = [entry for entry in sys.path if os.path.abspath(entry) != here]  # noqa: PTH100


if __name__ == "__main__":
    main()
