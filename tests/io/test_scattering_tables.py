"""Scattering functions in files: read as written, refused in one sentence."""
import gc
import sys

import numpy as np
import pytest
import xarray as xr

from mitsonar.io.scene_files.scattering_tables import read

FREQUENCY, ASPECT = np.array([90.0, 95.0, 100.0]), np.array([0.0, 45.0, 90.0, 180.0])
FORM = (0.1 + 0.01 * np.arange(12).reshape(4, 3)) * np.exp(0.3j * np.arange(12).reshape(4, 3))


def lines(real=False):
    """Rows of a table in no order."""
    rows = [(a, f, FORM[i, k]) for i, a in enumerate(ASPECT) for k, f in enumerate(FREQUENCY)][::-1]
    if real:
        return ["aspect_deg,frequency_khz,real,imaginary"] + [f"{a},{f},{z.real},{z.imag}" for a, f, z in rows]
    return ["frequency_khz,aspect_deg,target_strength_db,phase_deg"] + [
        f"{f},{a},{20 * np.log10(abs(z))},{np.degrees(np.angle(z))}" for a, f, z in rows]


def dataset():
    """The same as netCDF has it."""
    return xr.Dataset({"real": (("frequency_khz", "aspect_deg"), FORM.T.real),
                       "imaginary": (("aspect_deg", "frequency_khz"), FORM.imag)},
                      {"frequency_khz": FREQUENCY, "aspect_deg": ASPECT})


@pytest.mark.parametrize("kind", ["levels", "parts", "netcdf"])
def test_what_is_written_is_read(tmp_path, kind):
    path = tmp_path / "target"
    if kind == "netcdf":
        dataset().to_netcdf(path, engine="h5netcdf")
    else:
        path.write_text("\n".join(lines(kind == "parts")))
    table = read(path)
    np.testing.assert_allclose(table.frequency, 1e3 * FREQUENCY)
    np.testing.assert_allclose(table.axes["aspect"], np.radians(ASPECT))
    np.testing.assert_allclose(table.values, FORM, rtol=1e-12)


@pytest.mark.parametrize("text, said", [
    ("", "no header"), ("frequency_khz,target_strength_db\n", "no records"),
    ("target_strength_db\n3\n", "no column frequency_khz"), ("frequency_khz\n3\n", "needs target_strength_db"),
    ("frequency_khz,target_strength_db,real,imaginary\n3,1,1,1\n", "one or the others"),
    ("frequency_khz,real\n3,1\n", "one or the others"), ("frequency_khz,frequency_khz\n3,1\n", "there twice"),
    ("frequency_khz,target_strength_db,colour\n3,1,1\n", "colour is unknown"),
    ("frequency_khz,target_strength_db\n3,nan\n", "not a finite number"),
    ("frequency_khz,target_strength_db\n3,400\n", "400"), ("frequency_khz,target_strength_db\n3,1\n3,2\n", "once"),
    ("frequency_khz,target_strength_db\n0,1\n", "0 or less"), ("frequency_khz,target_strength_db\n1e9,1\n", "kHz"),
    ("frequency_khz,aspect_deg,target_strength_db\n1,0,1\n2,1,1\n", "every combination once"),
    ("frequency_khz,aspect_deg,target_strength_db\n1,9999,1\n", "beyond 360"),
    ("frequency_khz,aspect_deg,incident_azimuth_deg,real,imaginary\n1,0,0,1,1\n", "the aspect or the others"),
    ("frequency_khz,real,imaginary\n1,0,0\n", "no value above 0"),
    ("frequency_khz,real,imaginary\n1,1e300,0\n", "check it")])
def test_bad_tables_are_refused(tmp_path, text, said):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=said) as caught:
        read(path)
    assert "\n" not in str(caught.value)


def test_damaged_and_odd_netcdf_files_are_refused(tmp_path):
    whole, cut, odd = (tmp_path / name for name in ("whole.nc", "cut.nc", "odd.nc"))
    dataset().to_netcdf(whole, engine="h5netcdf")
    cut.write_bytes(whole.read_bytes()[:2000])
    for other in (dataset().rename(aspect_deg="colour"), dataset().drop_vars("aspect_deg"), dataset()[["real"]],
                  dataset().rename(real="a", imaginary="b"), dataset() * np.nan):
        other.to_netcdf(odd, engine="h5netcdf")
        with pytest.raises(ValueError, match="scattering function"):
            read(odd)
    with pytest.raises(ValueError, match="cut.nc is no netCDF-4 file that can be read"):
        read(cut)
    with pytest.raises(FileNotFoundError):
        read(tmp_path / "none.csv")
    with pytest.raises(ValueError, match="folder"):
        read(tmp_path)


def test_nothing_is_said_beside_the_sentence_of_a_damaged_file(tmp_path, monkeypatch):
    """The library leaves half an object where four bytes of the superblock or the root group are damaged."""
    said = []
    monkeypatch.setattr(sys, "unraisablehook", said.append)
    dataset().to_netcdf(tmp_path / "whole.nc", engine="h5netcdf")
    whole, refused = (tmp_path / "whole.nc").read_bytes(), 0
    for place in (40, 100, 222, 260, 300, 500):
        (tmp_path / "a.nc").write_bytes(whole[:place] + bytes([246, 164, 231, 36]) + whole[place + 4:])
        try:
            read(tmp_path / "a.nc")
        except ValueError as error:
            assert "\n" not in str(error)
            refused += 1
    gc.collect()
    assert refused and not said
