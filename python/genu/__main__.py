"""``python -m genu``: the command build-model."""

from genu._command import main

main()
