"""`python -m thingmap.mapper.cli`."""

from .main import main

main()
