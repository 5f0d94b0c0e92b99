import pytest

from trigpoint.errors import PicksError
from trigpoint.picks import examine, read_picks, require_control, write_picks

# Name of the file; how many picks; the doubts about them.
PICKS = {
    "herzjesu_even_vs_odd/picks6.csv": (6, []),
    "herzjesu_even_vs_odd/picks9_three_outliers.csv": (9, ["picks_equal"]),
    "herzjesu_even_vs_odd/camera_centres.csv": (13, []),
    "herzjesu_even_vs_odd/structural_all_with_outliers.csv": (4683, ["picks_equal"] * 2),
    "lidar_ign_two_flightlines/correspondences.csv": (11, []),
    "monocular_trajectories/tum_fr1_xyz_orb_mono.csv": (32, []),
    "textbook_helmert/dewitt_6pt.csv": (6, []),
    "textbook_helmert/ghilani_4pt.csv": (4, []),
    "textbook_helmert/grafarend_awange_7pt.csv": (7, []),
    "textbook_helmert/umeyama1991_2d.csv": (3, ["picks_coplanar"]),
}

# Name of the file; what the refusal says.
FOREIGN = {
    "qgis_sheet.points": "QGIS georeferencer file.*two-dimensional",
    "odm_bellus_gcp_list.txt": "OpenDroneMap ground control list",
    "odm_copr_gcp_list.txt": "OpenDroneMap ground control list",
    "cloudcompare_icp_rigid_MATRIX.txt": "4 x 4 matrix",
    "cloudcompare_icp_adjustscale_MATRIX.txt": "4 x 4 matrix",
    "matrix4x4_small_gicp.txt": "4 x 4 matrix",
    "helmert3d_param.txt": "no column id",
    "pix4d_test_offset.xyz": "no column id",
    "evo_georeferenced.tum": "no column id",
    "tanksandtemples_mapping.txt": "no column id",
    "tanksandtemples_test.log": "no column id",
    "opensfm_berlin_ground_control_points.json": "no column id",
    "ign_lareunion_epsg2975.laz": "not UTF-8 text",
    "pdal_A_B.e57": "not UTF-8 text",
}


@pytest.mark.parametrize("name", PICKS)
def test_real_picks_are_read_and_written_back_the_same(name, real_data, tmp_path):
    count, codes = PICKS[name]
    picks = read_picks(real_data(name))
    require_control(picks)
    assert len(picks) == len(picks.control) == count
    assert [caution.code for caution in examine(picks)] == codes
    write_picks(tmp_path / "again.csv", picks)
    again = read_picks(tmp_path / "again.csv")
    assert again.ids == picks.ids
    assert again.source.tobytes() == picks.source.tobytes()
    assert again.target.tobytes() == picks.target.tobytes()
    assert again.extra.equals(picks.extra)


@pytest.mark.parametrize("name", FOREIGN)
def test_what_is_no_pick_file_is_refused_in_one_clear_line(name, real_data):
    with pytest.raises(PicksError, match=FOREIGN[name]) as caught:
        read_picks(real_data(f"format_zoo/{name}"))
    assert str(caught.value).startswith(name)
    assert "\n" not in str(caught.value)
