"""What a view draws while it moves, by how long its last pictures took."""

from trigpoint_panel.pace import BUDGET, FEWEST, FIRST, STEPS, Pace


def moved(pace, seconds, pictures=12, points=10**9):
    """Return what was drawn in a movement, where a picture takes `seconds` of its points."""
    drawn = []
    for _ in range(pictures):
        drawn.append((pace.count, pace.is_lit))
        count = min(pace.count, points)
        pace.took(seconds(count, pace.is_lit), count)
    return drawn


def slow(count, is_lit):
    return 1e-6 * count + 0.05 * is_lit


def quick(count, _):
    return 0.001 + 1e-9 * count


def test_a_slow_machine_loses_its_lighting_first_and_then_points_until_it_is_fluid():
    pace = Pace()
    drawn = moved(pace, slow)
    assert drawn[0] == (FIRST, True)
    assert (FIRST, False) in drawn
    assert slow(pace.count, pace.is_lit) <= 1.3 * BUDGET
    assert drawn == sorted(drawn, reverse=True)
    pace.rested()
    assert len(set(moved(pace, slow))) == 1


def test_during_a_movement_nothing_is_added_and_the_next_shows_what_there_is_time_for():
    pace = Pace()
    assert set(moved(pace, quick)) == {(FIRST, True)}
    pace.rested()
    assert pace.count > 10 * FIRST
    assert quick(pace.count, True) <= BUDGET


def test_a_single_picture_that_takes_long_takes_nothing_away():
    pace = Pace()
    for seconds in (3.0, 0.02, 0.02, 1.0, 0.02, 0.02):
        assert not pace.took(seconds, pace.count)
    assert (pace.count, pace.is_lit) == (FIRST, True)


def test_few_pictures_tell_nothing():
    pace = Pace()
    pace.took(3.0, pace.count)
    pace.rested()
    pace.took(1e-4, pace.count)
    pace.rested()
    assert (pace.count, pace.is_lit) == (FIRST, True)


def test_a_machine_that_was_busy_gets_everything_back():
    pace = Pace()
    moved(pace, lambda *_: 1.0, pictures=60)
    assert (pace.count, pace.is_lit) == (FEWEST, False)
    pace.rested()
    moved(pace, quick)
    pace.rested()
    assert pace.is_lit
    assert pace.count > FIRST


def test_a_small_cloud_that_is_drawn_whole_is_measured_by_its_points():
    pace = Pace(STEPS[-1])
    moved(pace, slow, points=100_000)
    assert slow(pace.count, False) <= 1.3 * BUDGET
