from .execute import Outcome as Outcome, run as run
from .plan import Plan as Plan, Render as Render, load_plan as load_plan
