"""From what an echo sounder measures, angles and times, to soundings; and the planning of surveys.

    record        what a line of soundings holds: one `xarray.Dataset`, whoever made it
    detection     the bed in the beams of a ping, by amplitude or by phase
        bottom_track         where it is, roughly, in all beams at once
        amplitude_detection  the centre of gravity of an echo
        phase_detection      the zero crossing between the halves of a split beam
        windows              stretches of samples of different lengths
    quality       how well an echo's time is known
    attitude      place and attitude of a platform at any time, from the samples of its motion sensors
    legs          rays through the layers between an array and the bed
        columns              many layers at once, by a table
    reduction     soundings from angles and times to places
    resounding    a record reduced anew, with another profile or another sound speed of the head
    sounding_beams  what of a record no profile has touched: horizontal slowness and time
    bottom_backscatter, snippets     the bed's strength, sounding by sounding and sample by sample
    errors        errors of soundings by cause: detection, refraction, motion
    smile         what a wrong profile or head's speed does to a swath, by ray theory
    uncertainty   a priori, of depth and place, from the accuracies of all sensors
    losses        spreading and absorption on the way to a sounding
    gridding      soundings on square cells; what a grid errs by
"""
