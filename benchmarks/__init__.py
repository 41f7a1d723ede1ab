"""What is measured; each module is a command."""

import os

# processor times are those of one processor; whoever wants more says so
os.environ.setdefault("OMP_NUM_THREADS", "1")
