"""Every constant that can change a verdict, what it decides, and where it comes from.

*Derived*: follows from something else that is named. *Measured*: on data, as said. *Chosen*: a round number; the
campaigns in docs/diagnosis/validation.md were run with it, and no study compares it with others.
What one cause alone has (tolerances, typical sizes, grids of its shapes) is in its file.

"""

from discrepancy.rules.inference import *  # noqa: F403
from discrepancy.rules.laws import *  # noqa: F403
from discrepancy.rules.team import *  # noqa: F403
