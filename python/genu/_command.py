"""The command build-model, as pip installs it."""

import signal
import sys

from genu import _genu


def main() -> None:
    """Run the command line of this process and leave with its exit status."""
    # Ctrl-C ends the command at once, as it does the program without Python; what is finished is kept.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_genu.main(["build-model", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
