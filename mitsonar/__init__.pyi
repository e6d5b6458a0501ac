from . import (
    comparison as comparison,
    dataset as dataset,
    gradients as gradients,
    hydrography as hydrography,
    imaging as imaging,
    inversion as inversion,
    io as io,
    plots as plots,
    plugins as plugins,
    propagation as propagation,
    scattering as scattering,
    seabed as seabed,
    signal as signal,
    sonar as sonar,
    sweep as sweep,
    synthetic_aperture as synthetic_aperture,
    units as units,
    water as water,
)
from .comparison.comparing import compare as compare
from .device.llvm import BackendError as BackendError
from .io.reading import read as read, write as write
from .plots.sheets.scene_sheet import show as show
from .scene.loading import load_file as load_file
from .verbs.gradients import (
    coherent_model as coherent_model,
    differentiable_signals as differentiable_signals,
    directional_derivative as directional_derivative,
    gradient as gradient,
    gradient_check as gradient_check,
    scene_model as scene_model,
)
from .verbs.guide import describe as describe, scenes as scenes
from .verbs.images import (
    element_signals as element_signals,
    frames as frames,
    impulse_response as impulse_response,
    render as render,
    soundings as soundings,
)
from .verbs.stepping import Sonar as Sonar
from .verbs.strips import focus as focus, raw_echoes as raw_echoes
from .viewing.viewer import view as view

__version__: str
