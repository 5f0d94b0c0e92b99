import numpy as np
import pytest
from numpy.testing import assert_allclose

from trigpoint.reliability import assess
from trigpoint.similarity import umeyama

UTM = np.array([741_000.0, 4_279_000.0, 150.0])


# py4dgeo fills integers with NaN in its worker processes, which inherit our filters.
@pytest.mark.filterwarnings("ignore")
def test_m3c2_ep_propagates_the_covariance_that_we_export(similarity_from, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # importing py4dgeo opens a log file where it stands
    py4dgeo = pytest.importorskip("py4dgeo", reason="py4dgeo reads the covariance back")
    rng = np.random.default_rng(1)
    source = rng.normal(size=(6, 3)) * [3, 4, 6]
    target = similarity_from(1, UTM)(source) + rng.normal(0, 0.1, source.shape)
    worth = assess(source, target, umeyama(source, target))

    side = np.stack(np.meshgrid(np.linspace(0, 8, 81), np.linspace(0, 8, 81)), axis=-1)
    floor = np.column_stack([side.reshape(-1, 2), np.zeros(81 * 81)]) + worth.centroid + 5
    scanner = [
        {"origin": worth.centroid.tolist(), "sigma_range": 0, "sigma_scan": 0, "sigma_yaw": 0}
    ]
    epochs = []
    for height in (0.0, 0.02):
        epoch = py4dgeo.Epoch(floor + np.array([0, 0, height]), scanpos_info=scanner)
        epoch.scanpos_id = np.ones(len(floor), np.int32)
        epochs.append(epoch)
    core = floor[rng.choice(len(floor), 20, replace=False)]
    inside = (np.abs(core - floor.mean(axis=0)) < 3.5).all(axis=1)
    core = core[inside]
    m3c2 = py4dgeo.M3C2EP(
        tfM=np.eye(3, 4),
        Cxx=worth.m3c2_covariance(worth.centroid),
        refPointMov=worth.centroid,
        corepoints=core,
        corepoint_normals=np.array([[0.0, 0, 1]]),
        normal_radii=(0.5,),
        cyl_radius=0.3,
        max_distance=0.5,
    )
    distances, _, covariances = m3c2.calculate_distances(*epochs)

    assert len(core) > 10
    assert_allclose(np.abs(distances), 0.02, atol=1e-6)
    # It averages over a cylinder's points, whose covariances curve a little about the core's.
    expected = worth.covariance_at(core)
    size = np.sqrt(np.einsum("nii->ni", expected))
    scaled = (covariances["cov2"] - expected) / (size[:, :, None] * size[:, None, :])
    assert_allclose(scaled, 0, atol=0.01)
    assert_allclose(covariances["cov1"], 0, atol=1e-15)
