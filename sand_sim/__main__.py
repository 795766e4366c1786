"""``python -m sand_sim``."""

import sys

from sand_sim.cli.main import main

sys.exit(main())
