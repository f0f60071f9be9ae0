//! Files that appear complete or not at all.

use super::*;

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

fn beside(path: &Path) -> Result<Staged> {
    Staged::beside(path, Existing::Replace, &Trouble::default())
}

#[test]
fn a_file_appears_complete_or_not_at_all() {
    let at = tempfile::tempdir().unwrap();
    let path = at.path().join("out.las");
    fs::write(&path, "old").unwrap();
    let staged = beside(&path).unwrap();
    fs::write(staged.file(), "ne").unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");
    drop(staged);
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");
    let staged = beside(&path).unwrap();
    fs::write(staged.file(), "new").unwrap();
    publish(&[staged], None).unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), "new");
    assert_eq!(names(at.path()), ["out.las"]);
}

#[test]
fn a_link_is_replaced_and_what_it_means_is_spared() {
    let at = tempfile::tempdir().unwrap();
    let (path, other) = (at.path().join("out.las"), at.path().join("other.las"));
    fs::write(&other, "other").unwrap();
    std::os::unix::fs::symlink(&other, &path).unwrap();
    let staged = beside(&path).unwrap();
    fs::write(staged.file(), "new").unwrap();
    publish(&[staged], None).unwrap();
    assert_eq!(fs::read_to_string(&other).unwrap(), "other");
    assert_eq!(fs::read_to_string(&path).unwrap(), "new");
}

#[test]
fn places_where_no_file_can_appear_are_refused_before_any_work() {
    let at = tempfile::tempdir().unwrap();
    let told = |path: &Path| beside(path).unwrap_err().to_string();
    assert!(told(&at.path().join("none/out.las")).ends_with("none: the folder does not exist"));
    assert!(told(at.path()).contains("a folder, not a file"));
    assert!(told(Path::new("/dev/null")).contains("no regular file"));
    assert_eq!(names(at.path()), [""; 0]);
}

#[test]
fn errors_are_about_the_file_that_the_user_named() {
    let at = tempfile::tempdir().unwrap();
    let path = at.path().join("out.las");
    let staged = beside(&path).unwrap();
    let full = std::io::Error::from(std::io::ErrorKind::StorageFull);
    let error = staged.tell(Error::io(staged.file(), "write it", full));
    assert_eq!(error.path(), Some(path.as_path()));
    assert!(error.remedy().unwrap().contains("free some disk space"));
    let error = staged.tell(Error::data("in.las", "odd"));
    assert_eq!(error.path(), Some(Path::new("in.las")));
}

#[test]
fn a_replaced_file_keeps_its_mode_and_a_new_one_has_the_usual() {
    let at = tempfile::tempdir().unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    let usual = at.path().join("usual");
    fs::write(&usual, "").unwrap();
    let written = |path: &Path| {
        let staged = beside(path).unwrap();
        fs::write(staged.file(), "new").unwrap();
        publish(&[staged], None).unwrap();
        mode(path)
    };
    let path = at.path().join("out.las");
    assert_eq!(written(&path), mode(&usual));
    for mode in [0o600, 0o664, 0o640, 0o444] {
        fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
        assert_eq!(written(&path), mode);
    }
}

#[test]
fn a_file_that_appears_meanwhile_is_spared_if_nothing_is_to_be_replaced() {
    let at = tempfile::tempdir().unwrap();
    let (path, other) = (at.path().join("out.las"), at.path().join("other.las"));
    let refusing = |path: &Path| Staged::beside(path, Existing::Refuse, &Trouble::default());
    let staged = refusing(&path).unwrap();
    let also = staged.also(&other, &Trouble::default()).unwrap();
    fs::write(staged.file(), "new").unwrap();
    fs::write(also.file(), "new").unwrap();
    fs::write(&other, "theirs").unwrap();
    let error = publish(&[staged, also], None).unwrap_err();
    assert_eq!((error.kind(), error.path()), (ErrorKind::Io, Some(other.as_path())));
    let remedy = error.remedy().unwrap();
    assert!(remedy.contains("in place already: ") && remedy.contains("out.las"), "{remedy}");
    assert!(remedy.ends_with("; the other 1 of 2 files are as they were"), "{remedy}");
    assert_eq!(fs::read_to_string(&other).unwrap(), "theirs");
    assert_eq!(fs::read_to_string(&path).unwrap(), "new");
    assert!(refusing(&path).unwrap_err().to_string().contains("this file exists"));
    // So is a link that leads nowhere.
    let link = at.path().join("link.las");
    std::os::unix::fs::symlink("nowhere", &link).unwrap();
    assert!(refusing(&link).is_err());
    assert_eq!(names(at.path()), ["link.las", "other.las", "out.las"]);
    // By the way that every file system has.
    fs::write(at.path().join("staged"), "x").unwrap();
    let linked = fs::hard_link(at.path().join("staged"), &path).unwrap_err();
    assert_eq!(linked.kind(), io::ErrorKind::AlreadyExists);
}

#[test]
fn what_is_in_place_when_a_rename_fails_is_told() {
    let at = tempfile::tempdir().unwrap();
    let path = |name: &str| at.path().join(name);
    let first = beside(&path("a.las")).unwrap();
    let second = first.also(&path("b.las"), &Trouble::default()).unwrap();
    let report = first.also(&path("r.json"), &Trouble::default()).unwrap();
    for staged in [&first, &second, &report] {
        fs::write(staged.file(), "new").unwrap();
    }
    // A folder takes the second's place.
    fs::create_dir(path("b.las")).unwrap();
    let error = publish(&[first, second], Some(&report)).unwrap_err();
    assert_eq!(error.path(), Some(path("b.las").as_path()));
    let told = format!("in place already: {}; the other 2 of 3", path("a.las").display());
    assert!(error.remedy().unwrap().contains(&told), "{error:?}");
    drop(report);
    assert_eq!(names(at.path()), ["a.las", "b.las"]);
}

#[test]
fn a_folder_is_made_with_those_above_it() {
    let at = tempfile::tempdir().unwrap();
    let deep = at.path().join("a/b/c");
    let made = make_folder(&deep).unwrap();
    assert_eq!(made, ["a", "a/b", "a/b/c"].map(|name| at.path().join(name)));
    assert_eq!(make_folder(&deep).unwrap(), [""; 0].map(PathBuf::from));
    fs::write(at.path().join("file"), "x").unwrap();
    assert_eq!(make_folder(&at.path().join("file/d")).unwrap_err().kind(), ErrorKind::Io);
}
