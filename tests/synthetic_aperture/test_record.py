"""What is no record of raw echoes is refused in a sentence that names what is wrong."""
import numpy as np
import pytest
from raw_record import raw_record

from mitsonar.synthetic_aperture.record import check_raw

NO_NUMBER = float("nan")


def test_a_record_as_it_should_be():
    check_raw(raw_record())


@pytest.mark.parametrize("name, value", [
    ("frequency", NO_NUMBER), ("frequency", "300"), ("sampling_rate", 0.0), ("source_level_db", 1e30),
    ("absorption_db", -1.0), ("tx_length", np.inf), ("bed_depth", None), ("look", [0.0, 0.0, 0.0]), ("look", "down")])
def test_attributes_that_cannot_be(name, value):
    with pytest.raises(ValueError, match=f"the attribute {name} of raw echoes"):
        check_raw(raw_record().assign_attrs({name: value}))


def test_places_and_times_that_cannot_be():
    record = raw_record()
    with pytest.raises(ValueError, match="rx_position .* not finite"):
        check_raw(record.assign(rx_position=record["rx_position"] * NO_NUMBER))
    with pytest.raises(ValueError, match="do not go on evenly"):
        check_raw(record.assign_coords(time=record["time"] * 3))
    with pytest.raises(ValueError, match="lacks ping_time; give"):
        check_raw(record.drop_vars("ping_time"))
