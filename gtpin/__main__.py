"""``python -m gtpin`` is ``gtpin``."""

from gtpin.cli import main

if __name__ == "__main__":
    main()
