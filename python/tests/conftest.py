"""One phantom, built once for all tests."""

import pytest

import genu


@pytest.fixture(scope="session")
def specimen(tmp_path_factory):
    return genu.phantom("S192803-phantom", tmp_path_factory.mktemp("knee") / "specimen")


@pytest.fixture(scope="session")
def events():
    return []


@pytest.fixture(scope="session")
def build(specimen, events):
    # without calibration, which takes minutes; test_verbs calibrates with one start
    return genu.build(specimen, to="assemble", progress=lambda *event: events.append(event))


@pytest.fixture(scope="session")
def model(build):
    return build.model


@pytest.fixture(scope="session")
def trials():
    """Six drawers and two turns, as a laboratory's table."""
    pandas = pytest.importorskip("pandas")
    rows = []
    for flexion in (30, 60):
        for test, vv, ie, ap in (
            ("anterior", 0, 0, 100),
            ("posterior", 0, 0, -100),
            ("internal", 0, -4, 0),
            ("external", 0, 4, 0),
            ("varus", -8, 0, 0),
            ("valgus", 8, 0, 0),
        ):
            rows.append(
                {
                    "trial": f"{test}_{flexion}",
                    "test": test,
                    "nominal_flexion_deg": flexion,
                    "load_vv_nm": vv,
                    "load_ie_nm": ie,
                    "load_ml_n": 0,
                    "load_ap_n": ap,
                    "load_si_n": 20,
                    "fe_deg": flexion,
                    **dict.fromkeys(("vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm")),
                }
            )
    return pandas.DataFrame(rows)


@pytest.fixture(scope="session")
def measured(model, trials):
    """What a knee with a tighter ACL would answer at 30 deg; at 60 deg the uncalibrated phantom dislocates under the drawer."""
    trials = trials[trials["nominal_flexion_deg"] == 30].reset_index(drop=True)
    truth = model.copy()
    for name in ("ACL_AM", "ACL_PL"):
        truth.bundle(name)["reference_strain"] += 0.04
    poses = genu.simulate(truth, trials)
    return poses[[c for c in poses.columns if not c.startswith("force_")]]


@pytest.fixture(scope="session")
def calibration(model, measured, tmp_path_factory):
    seen = []
    folder = tmp_path_factory.mktemp("calibrated")
    found = genu.calibrate(
        model,
        measured,
        folder,
        options={"inference.samples": 24},
        progress=lambda stage, share, message: seen.append(share),
    )
    assert seen and all(0 <= s <= 1 for s in seen)
    return found
