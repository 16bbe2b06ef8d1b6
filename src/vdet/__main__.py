"""Entry point of the program, for `python -m vdet`."""

from vdet.process import run as main

if __name__ == "__main__":
    main()
