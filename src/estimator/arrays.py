"""What most of the numbers are in."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
