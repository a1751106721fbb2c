"""`python -m fractalcontact` is the command `fractalcontact`."""

from fractalcontact.cli import main

raise SystemExit(main())
