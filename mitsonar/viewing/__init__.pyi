from .page import ViewerPage as ViewerPage
from .viewer import view as view
