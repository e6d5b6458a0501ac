from .arrays.calibration import Calibration as Calibration, calibrated as calibrated
from .arrays.ping_images import PingImages as PingImages, moved as moved
from .arrays.sharpness import Sway as Sway, sharpened as sharpened, without_trend as without_trend
from .fitting.answer import Fit as Fit, FittedParameter as FittedParameter
from .fitting.classes import Classes as Classes
from .fitting.fitting import fit as fit
from .fitting.iteration import Stopping as Stopping
from .fitting.likelihood import Gamma as Gamma, Gaussian as Gaussian
from .fitting.priors import Prior as Prior
from .fitting.steps import LBFGS as LBFGS, TrustRegion as TrustRegion
from .images.heights import HeightPrior as HeightPrior, fit_heights as fit_heights
from .images.image_fit import Stage as Stage
from .images.pose import PosePrior as PosePrior, fit_pose as fit_pose
from .images.scene_fit import KeyPrior as KeyPrior, fit_scene as fit_scene
from .images.sediment_map import StrengthPrior as StrengthPrior, fit_sediment_map as fit_sediment_map
from .profile.profile import fit_lines as fit_lines, fit_profile as fit_profile
from .profile.profile_answer import ProfileFit as ProfileFit
from .profile.profile_problem import ProfilePrior as ProfilePrior
