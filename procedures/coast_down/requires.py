"""What it needs of a rig, and what it reads of it: what a run-up does."""

from procedures.run_up.requires import requires as requires
