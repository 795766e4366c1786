"""``python -m sand_sim.node``."""

import sys

from sand_sim.node.main import main

sys.exit(main())
