"""What ships with the package is read once and kept between processes, each file under a name of its own."""

from rig_nodes import config


def test_files_named_alike_are_kept_side_by_side_and_not_read_again(tmp_path, monkeypatch):
    alike = [config.package_file(f"{folder}/clutch_bench.yaml") for folder in ("rigs", "sequences")]
    monkeypatch.setattr(config, "cache_root", lambda: tmp_path / "kernel-cache")
    config._parsed.cache_clear()
    first = [config.load_yaml(path) for path in alike]
    assert len(list((tmp_path / "read-configuration").iterdir())) == 2
    config._parsed.cache_clear()  # as in another process
    monkeypatch.setattr(config, "_read", None)
    assert [config.load_yaml(path) for path in alike] == first and first[0] != first[1]


def test_an_edited_file_is_read_anew_and_takes_the_place_of_the_old(tmp_path, monkeypatch):
    monkeypatch.setattr(config, "CONFIG_DIR", tmp_path)
    monkeypatch.setattr(config, "cache_root", lambda: tmp_path / "cache" / "kernel-cache")
    path = tmp_path / "a.yaml"
    for text, value in (("a: 1", {"a": 1}), ("a: 23", {"a": 23})):
        path.write_text(text)
        assert config.load_yaml(path) == value
        assert len(list((tmp_path / "cache" / "read-configuration").iterdir())) == 1
