"""Writing results: other people's folders are refused, files named by --out are replaced."""

import dataclasses
import json
import os

import pytest
from pictures import pixels

from shapeopt import Problem, load_run, optimise, save_run
from shapeopt.commands import explore, march_flow, optimize_shape, payoff_command, render_shapes
from shapeopt.commands.arguments import body_settings
from surrogate import InvalidInput, Scene, load
from surrogate.files import check_file, whole_file


@pytest.fixture(scope="module")
def designed():
    net = load("pretrained")
    return optimise(Problem(net.scene, 20.0), net)


@pytest.mark.parametrize("name", ["contour.csv", "notes.txt", "run.json"])
def test_a_folder_without_a_run_in_it_is_refused(designed, tmp_path, name):
    (tmp_path / name).write_text('{"scripts": "other"}')
    with pytest.raises(InvalidInput, match="choose another folder"):
        save_run(tmp_path, designed)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == '{"scripts": "other"}'


def test_march_and_payoff_refuse_folders_with_other_files(tmp_path):
    (tmp_path / "thesis.txt").write_text("other")
    words = ["--aspect", "1", "--reynolds", "20", "--out", str(tmp_path)]
    with pytest.raises(InvalidInput, match=r"thesis\.txt"):
        march_flow.main(words)
    (tmp_path / "payoff" / "run-0").mkdir(parents=True)
    (tmp_path / "payoff" / "run-0" / "notes.txt").write_text("other")
    with pytest.raises(InvalidInput, match=r"run-0: is not empty"):
        payoff_command.main(["--out", str(tmp_path / "payoff")])


def test_another_march_into_the_folder_of_one_is_refused(tmp_path):
    stored = {"blockage": 0.1, "gif": "x", "incidence": 0.0, "reynolds": 30.0, "height": 16.0}
    (tmp_path / "march.json").write_text(json.dumps(stored))
    with pytest.raises(InvalidInput, match=r"holds another march \(.*--overwrite"):
        march_flow.main(["--aspect", "1", "--reynolds", "20", "--out", str(tmp_path)])


def test_a_march_that_is_done_is_not_marched_again(tmp_path, monkeypatch, capsys):
    def marched(*arguments, **settings):
        raise InvalidInput("marched")

    monkeypatch.setattr(march_flow, "_march", marched)
    words = ["--aspect", "1", "--reynolds", "20", "--out", str(tmp_path)]
    body = body_settings(march_flow._parser().parse_args(words))
    asked = {"body": body, "incidence": 0.0, "reynolds": 20.0, "height": 16.0, "time": 60.0}
    stored = {"reynolds": 20.0, "blockage": 0.06, "cd": 2.1, "cd_steady": None, "sheds": False}
    stored |= {"growth_rate": None, "strouhal": None, "gif": "elsewhere", "settings": asked}
    (tmp_path / "march.json").write_text(json.dumps(stored))
    with pytest.raises(InvalidInput, match="marched"):  # as its picture is not there
        march_flow.main(words)
    (tmp_path / "march.gif").write_bytes(b"")
    gif = str(tmp_path / "march.gif")
    assert march_flow.main([*words, "--json"]) == stored | {"gif": gif}
    said = capsys.readouterr()
    assert "this march is done already; --overwrite repeats it" in said.err
    assert json.loads(said.out)["gif"] == gif
    for more in (["--overwrite"], ["--table", str(tmp_path / "t.csv")]):
        with pytest.raises(InvalidInput, match="marched"):
            march_flow.main([*words, *more])


def test_another_payoff_into_the_folder_of_one_is_refused(tmp_path):
    stored = {"payoff": [], "queries": [], "settings": {"preset": "quick"}}
    for settings, words in ((stored["settings"], r"preset quick, not full"), (None, "unknown")):
        record = json.dumps(stored | {"settings": settings})
        (tmp_path / "payoff.json").write_text(record)
        with pytest.raises(InvalidInput, match=rf"holds another payoff \(.*{words}.*--overwrite"):
            payoff_command.main(["--preset", "full", "--out", str(tmp_path)])
        assert (tmp_path / "payoff.json").read_text() == record


@pytest.mark.parametrize("file", ["memory.json", "cache/memory.json"])
def test_the_memory_file_must_be_outside_the_run(tmp_path, file):
    words = ["--until", "flow", "--reynolds", "20", "--out", f"{tmp_path}/a"]
    with pytest.raises(InvalidInput, match="choose a file outside it"):
        optimize_shape.main([*words, "--memory", f"{tmp_path}/a/{file}"])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "change",
    [{"path": []}, {"path": [[2.0, 0.9, 0.0, 0.0]]}, {"surrogate": 5}, {"cd_verified": "abc"},
     {"cd_start": -1.0}, {"cases": 5}, {"reynolds": 1e9}, {"about_lift": 0}, {"objective": {}}],
    ids=str,
)  # fmt: skip
def test_an_altered_run_is_refused(designed, tmp_path, change):
    save_run(tmp_path / "run", designed, verify=False)
    record = json.loads((tmp_path / "run" / "run.json").read_text())
    (tmp_path / "run" / "run.json").write_text(json.dumps(record | change))
    with pytest.raises(InvalidInput, match="damaged, or of another program or version"):
        load_run(tmp_path / "run")


def test_a_symbolic_link_is_written_through(tmp_path):
    (tmp_path / "kept.json").write_text("old")
    (tmp_path / "link.json").symlink_to(tmp_path / "kept.json")
    with whole_file(tmp_path / "link.json") as part:
        part.write_text("new")
    assert (tmp_path / "link.json").is_symlink()
    assert (tmp_path / "kept.json").read_text() == "new"


def test_a_link_that_leads_back_to_itself_is_refused(designed, tmp_path):
    for name in ("loop", "loop.toml", "loop.csv"):
        (tmp_path / name).symlink_to(tmp_path / name)
    calls = (
        lambda: Scene().write(tmp_path / "loop.toml"),
        lambda: save_run(tmp_path / "loop", designed),
        lambda: check_file(tmp_path / "loop.csv", ".csv"),
    )
    for call in calls:
        with pytest.raises(InvalidInput, match="leads back to itself"):
            call()


@pytest.mark.parametrize(("umask", "mode"), [(0o077, 0o600), (0o022, 0o644)])
def test_new_files_have_the_permissions_of_the_umask(tmp_path, umask, mode):
    """Files that are replaced keep their own."""
    before = os.umask(umask)
    try:
        Scene().write(tmp_path / "a.toml")
        assert (tmp_path / "a.toml").stat().st_mode & 0o777 == mode
        (tmp_path / "a.toml").chmod(0o640)
        Scene().write(tmp_path / "a.toml")
    finally:
        os.umask(before)
    assert (tmp_path / "a.toml").stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("name", ["photo.png", "film.gif"])
def test_a_picture_replaces_the_file_it_is_named_after(designed, tmp_path, name):
    few = dataclasses.replace(designed, path=designed.path[[0, -1]])  # frames of the film
    save_run(tmp_path / "run", few, verify=False)
    (tmp_path / name).write_bytes(b"old")
    render_shapes.main(["--runs", str(tmp_path / "run"), "--out", str(tmp_path / name)])
    pixels(tmp_path / name)
    assert {path.name for path in tmp_path.iterdir()} == {"run", name}


def test_a_page_replaces_the_file_it_is_named_after(tmp_path):
    (tmp_path / "page.html").write_text("<html>old</html>")
    explore.main(["--out", str(tmp_path / "page.html")])
    assert "<svg" in (tmp_path / "page.html").read_text()


def test_a_scene_replaces_the_file_it_is_named_after_but_no_folder(tmp_path):
    (tmp_path / "scene.toml").write_text("old")
    Scene().write(tmp_path / "scene.toml")
    assert Scene.read(tmp_path / "scene.toml") == Scene()
    with pytest.raises(InvalidInput, match="is a folder"):
        Scene().write(tmp_path)
