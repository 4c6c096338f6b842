//! A job of many faces: one file with `[part]` and a `[[face]]` for each, in the order in which they are machined. Each becomes a job of its own, `FILE#FACE`:
//!
//! ```text
//! [part] path ───────────► [surface] kind = "file", path        [[face]] face, tolerance_mm, parameters ──► [surface]
//! [tool] [cut] [machine] ... as they are                         [[face]] everything else ────────────────► [cut]
//! ```

use std::path::{Path, PathBuf};

use job::JobError;
use toml::{Table, Value};

use super::text;

/// Keys of `[[face]]` that belong to the surface.
const OF_SURFACE: [&str; 3] = ["face", "tolerance_mm", "parameters"];
/// Sections that a job of many faces may not have.
const FOREIGN: [&str; 2] = ["surface", "region"];

/// The file and the number of the face that a path `FILE#FACE` names; a path that is a file has no number.
fn split(path: &Path) -> (PathBuf, Option<usize>) {
    let text = path.to_string_lossy();
    let named = text
        .rsplit_once('#')
        .filter(|_| !path.exists())
        .and_then(|(file, number)| Some((PathBuf::from(file), number.parse().ok()?)));
    named.map_or_else(|| (path.to_owned(), None), |(file, number)| (file, Some(number)))
}

/// The file that a job's path names, without the face of `FILE#FACE`.
#[must_use]
pub fn file_of(path: &Path) -> PathBuf {
    split(path).0
}

/// The jobs of a file: `FILE#FACE` for each face of a job of many, else the file itself.
///
/// # Errors
/// A `[[face]]` is not valid.
pub fn jobs_of(path: &Path) -> Result<Vec<PathBuf>, JobError> {
    let (file, None) = split(path) else {
        return Ok(vec![path.to_owned()]);
    };
    let Ok(text) = text::read(&file) else {
        // The reader of the job tells why.
        return Ok(vec![path.to_owned()]);
    };
    let Some(table) = table_of(&text) else {
        return Ok(vec![path.to_owned()]);
    };
    let numbers = numbers(&path.display().to_string(), &table)?;
    let named = |number: &usize| PathBuf::from(format!("{}#{number}", path.display()));
    Ok(numbers.iter().map(named).collect())
}

/// The text of a job file, or of one face of a job of many, and the path of that file.
///
/// # Errors
/// The file cannot be read; it has several faces and the path names none, or has no such face.
pub(super) fn read(path: &Path) -> Result<String, JobError> {
    let name = path.display().to_string();
    let (file, number) = split(path);
    let text = text::read(&file)?;
    let table = table_of(&text);
    match (table, number) {
        (None, None) => Ok(text),
        (None, Some(number)) => Err(JobError::of_file(
            &name,
            format!("the job has one surface, no face {number}"),
            format!("write {}", file.display()),
        )),
        (Some(table), None) => {
            let numbers = numbers(&name, &table)?;
            if let [only] = numbers[..] {
                return one(&name, table, only);
            }
            let first = numbers.first().copied().unwrap_or(1);
            Err(JobError::of_file(
                &name,
                format!("the job has {} faces, and this command takes one", numbers.len()),
                format!("name one: {name}#{first}; `verify` and `run` take all of them"),
            ))
        }
        (Some(table), Some(number)) => one(&name, table, number),
    }
}

/// The tables of a job of many faces; `None` for any other text.
fn table_of(text: &str) -> Option<Table> {
    let table: Table = text.parse().ok()?;
    table.contains_key("face").then_some(table)
}

/// The faces as tables, each with its number.
fn faces<'t>(name: &str, table: &'t Table) -> Result<Vec<(usize, &'t Table)>, JobError> {
    let wrong =
        |what: String| JobError::of_file(name, what, "write a section [[face]] with face = N for each face");
    let Some(Value::Array(faces)) = table.get("face") else {
        return Err(wrong("`face` is no list of sections".to_owned()));
    };
    let number = |face: &'t Value| {
        let face = face.as_table()?;
        let number = usize::try_from(face.get("face")?.as_integer()?).ok()?;
        Some((number, face))
    };
    let found: Vec<_> = faces.iter().filter_map(number).collect();
    if found.len() < faces.len() || found.is_empty() {
        return Err(wrong(
            "a section [[face]] lacks the number of its face".to_owned(),
        ));
    }
    for (index, (number, _)) in found.iter().enumerate() {
        if found[..index].iter().any(|(before, _)| before == number) {
            return Err(wrong(format!("face {number} occurs twice")));
        }
    }
    Ok(found)
}

fn numbers(name: &str, table: &Table) -> Result<Vec<usize>, JobError> {
    Ok(faces(name, table)?
        .into_iter()
        .map(|(number, _)| number)
        .collect())
}

/// The job of one face.
fn one(name: &str, mut table: Table, number: usize) -> Result<String, JobError> {
    let numbers = numbers(name, &table)?;
    let found = faces(name, &table)?.into_iter().find(|(of, _)| *of == number);
    let Some(face) = found.map(|(_, face)| face.clone()) else {
        return Err(JobError::of_file(
            name,
            format!("the job has no face {number}"),
            format!("its faces: {numbers:?}"),
        ));
    };
    if let Some(section) = FOREIGN.iter().find(|section| table.contains_key(**section)) {
        return Err(JobError::of_file(
            name,
            format!("a job of many faces has no section [{section}]"),
            "its surfaces are faces of the file that [part] names, its regions are made from them",
        ));
    }
    let Some(path) = table.get("part").and_then(|part| part.get("path")).cloned() else {
        return Err(JobError::of_file(
            name,
            "a job of many faces needs the file that they are of".to_owned(),
            "write [part] with path = \"FILE.step\"",
        ));
    };
    table.remove("face");
    let mut surface = Table::from_iter([
        ("kind".to_owned(), Value::from("file")),
        ("path".to_owned(), path),
    ]);
    let cut = table.entry("cut").or_insert_with(|| Value::Table(Table::new()));
    for (key, value) in face {
        if OF_SURFACE.contains(&key.as_str()) {
            surface.insert(key, value);
        } else if let Some(cut) = cut.as_table_mut() {
            cut.insert(key, value);
        }
    }
    table.insert("surface".to_owned(), Value::Table(surface));
    toml::to_string(&table).map_err(|error| JobError::of_file(name, error.to_string(), "correct the section"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PART: &str = "[part]\npath = \"a.step\"\n[tool]\nkind = \"ball\"\nradius_mm = 3\n[cut]\nfeed_mm_min = 600\nscallop_mm = 0.01\n\
                        [[face]]\nface = 7\nalong = \"v\"\n[[face]]\nface = 2\nalong = \"u\"\nfeed_mm_min = 900\n";

    #[test]
    fn each_face_is_a_job() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("part.toml");
        std::fs::write(&file, PART).unwrap();
        let jobs = jobs_of(&file).unwrap();
        assert_eq!(jobs.len(), 2);
        assert!(jobs[0].to_string_lossy().ends_with("part.toml#7"));
        let job: Table = read(&jobs[1]).unwrap().parse().unwrap();
        assert_eq!(job["surface"]["face"].as_integer(), Some(2));
        assert_eq!(job["surface"]["path"].as_str(), Some("a.step"));
        assert_eq!(job["cut"]["feed_mm_min"].as_integer(), Some(900));
        assert_eq!(job["cut"]["along"].as_str(), Some("u"));
        assert!(!job.contains_key("face"));
        // One that is named is taken as it is.
        assert_eq!(jobs_of(&jobs[0]).unwrap(), [jobs[0].clone()]);
    }

    /// A job of one face is read without its number.
    #[test]
    fn the_only_face_needs_no_number() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("part.toml");
        let (head, _) = PART.rsplit_once("[[face]]").unwrap();
        std::fs::write(&file, head).unwrap();
        let job: Table = read(&file).unwrap().parse().unwrap();
        assert_eq!(job["surface"]["face"].as_integer(), Some(7));
    }

    #[test]
    fn what_is_wrong_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("part.toml");
        let said = |text: &str, path: &Path| {
            std::fs::write(&file, text).unwrap();
            read(path).unwrap_err().what().to_owned()
        };
        let named = |number: usize| PathBuf::from(format!("{}#{number}", file.display()));
        assert!(said(PART, &file).contains("2 faces"));
        assert!(said(PART, &named(3)).contains("no face 3"));
        assert!(said(&PART.replace("face = 2", "face = 7"), &named(7)).contains("twice"));
        assert!(said(&PART.replace("path = \"a.step\"", ""), &named(7)).contains("needs the file"));
        assert!(said(&format!("{PART}[region]\nloops = []\n"), &named(7)).contains("[region]"));
        assert!(said("[surface]\nkind = \"nurbs\"\n", &named(1)).contains("one surface"));
    }
}
