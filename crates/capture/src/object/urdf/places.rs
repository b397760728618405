//! Where the files lie that a URDF names: `package://NAME/rest`, `file://`, plain paths,
//! backslashes.

use crate::object::mesh_file::unescaped;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// How deep packages are looked for below a folder of `ROS_PACKAGE_PATH`: workspace, repository,
/// group, package.
const MOST_DEPTH: usize = 4;

/// The folders that names count from.
pub(super) struct Places {
    /// The URDF's own.
    folder: PathBuf,
    /// Folders that hold packages, or are one.
    roots: Vec<PathBuf>,
    /// Folders of the packages that were asked for: a search may read many folders.
    known: RefCell<BTreeMap<String, Vec<PathBuf>>>,
}

impl Places {
    pub fn of(file: &Path) -> Self {
        let list = |name: &str| {
            let value = std::env::var_os(name).unwrap_or_default();
            std::env::split_paths(&value).filter(|p| !p.as_os_str().is_empty()).collect::<Vec<_>>()
        };
        let mut roots = list("ROS_PACKAGE_PATH");
        roots.extend(list("AMENT_PREFIX_PATH").into_iter().map(|p| p.join("share")));
        Self { folder: file.parent().unwrap_or(Path::new(".")).to_path_buf(), roots, known: RefCell::default() }
    }

    /// The file that `name` stands for; when it is nowhere, the likeliest path.
    pub fn find(&self, name: &str) -> PathBuf {
        let plain = name.trim().replace('\\', "/");
        let found = self.candidates(&plain).into_iter().find(|p| p.is_file());
        // %20 may be a space, or a name may hold it as it is.
        let decoded = || unescaped(&plain).and_then(|n| self.candidates(&n).into_iter().find(|p| p.is_file()));
        found.or_else(decoded).unwrap_or_else(|| self.candidates(&plain).swap_remove(0))
    }

    fn candidates(&self, name: &str) -> Vec<PathBuf> {
        let Some((scheme, rest)) = name.split_once("://") else { return vec![self.folder.join(name)] };
        if scheme.eq_ignore_ascii_case("file") {
            return vec![self.folder.join(rest.strip_prefix("localhost/").map_or(rest.into(), |r| format!("/{r}")))];
        }
        let (package, rest) = rest.split_once('/').unwrap_or(("", rest));
        let mut out: Vec<PathBuf> = self.package(package).into_iter().map(|p| p.join(rest)).collect();
        // A package whose folder was renamed: beside the URDF, as yourdfpy looks for it, and above.
        out.push(self.folder.join(package).join(rest));
        out.extend(self.above().iter().map(|p| p.join(rest)));
        out
    }

    /// Folders of the package, the nearest above the URDF first.
    fn package(&self, name: &str) -> Vec<PathBuf> {
        let search = || {
            let above = self.above().into_iter().filter(|p| is_package(p, name));
            above.chain(self.roots.iter().filter_map(|root| below(root, name, 0))).collect()
        };
        self.known.borrow_mut().entry(name.to_string()).or_insert_with(search).clone()
    }

    fn above(&self) -> Vec<PathBuf> {
        let folder = std::path::absolute(&self.folder).unwrap_or_else(|_| self.folder.clone());
        folder.ancestors().map(Path::to_path_buf).collect()
    }
}

fn is_package(folder: &Path, name: &str) -> bool {
    folder.file_name().is_some_and(|f| f == name) || package_name(folder).as_deref() == Some(name)
}

/// `<name>` in the folder's package.xml.
fn package_name(folder: &Path) -> Option<String> {
    let text = std::fs::read_to_string(folder.join("package.xml")).ok()?;
    let xml = roxmltree::Document::parse(&text).ok()?;
    let name = xml.root_element().children().find(|n| n.tag_name().name() == "name")?;
    name.text().map(|t| t.trim().to_string())
}

/// The package in a folder or below it; packages do not hold packages.
fn below(folder: &Path, name: &str, depth: usize) -> Option<PathBuf> {
    if is_package(folder, name) {
        return Some(folder.to_path_buf());
    }
    let direct = folder.join(name);
    if direct.is_dir() {
        return Some(direct);
    }
    if depth == MOST_DEPTH || folder.join("package.xml").is_file() {
        return None;
    }
    let mut folders: Vec<PathBuf> =
        std::fs::read_dir(folder).ok()?.flatten().map(|e| e.path()).filter(|p| p.is_dir()).collect();
    folders.sort();
    folders.iter().find_map(|f| below(f, name, depth + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn touch(file: &Path) {
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, "").unwrap();
    }

    #[test]
    fn packages_are_found_above_the_urdf_and_where_ros_looks() {
        let dir = tempfile::tempdir().unwrap();
        let ws = dir.path().join("ws");
        let own = ws.join("arm-main");
        touch(&own.join("meshes/a b.stl"));
        touch(&own.join("meshes/c%20d.stl"));
        std::fs::write(own.join("package.xml"), "<package><name> arm </name></package>").unwrap();
        touch(&ws.join("src/repo/gripper/meshes/g.stl"));
        std::fs::write(ws.join("src/repo/gripper/package.xml"), "<package><name>hand</name></package>").unwrap();
        touch(&ws.join("install/share/base/b.stl"));
        let roots = vec![ws.join("nowhere"), ws.join("src"), ws.join("install/share")];
        let places = Places { folder: own.join("urdf"), roots, known: RefCell::default() };
        for (name, file) in [
            ("package://arm/meshes/a b.stl", own.join("meshes/a b.stl")),
            ("package://arm/meshes/a%20b.stl", own.join("meshes/a b.stl")),
            ("package://arm/meshes/c%20d.stl", own.join("meshes/c%20d.stl")),
            ("package:\\\\arm\\meshes\\a b.stl", own.join("meshes/a b.stl")),
            // Under a name that no package.xml knows, from the folders above.
            ("package://renamed/meshes/a b.stl", own.join("meshes/a b.stl")),
            ("package://hand/meshes/g.stl", ws.join("src/repo/gripper/meshes/g.stl")),
            ("package://gripper/meshes/g.stl", ws.join("src/repo/gripper/meshes/g.stl")),
            ("package://base/b.stl", ws.join("install/share/base/b.stl")),
            ("model://base/b.stl", ws.join("install/share/base/b.stl")),
        ] {
            assert_eq!(places.find(name), file, "{name}");
        }
        let absolute = ws.join("install/share/base/b.stl");
        assert_eq!(places.find(&format!("file://{}", absolute.display())), absolute);
        assert_eq!(places.find(&format!("file://localhost{}", absolute.display())), absolute);
        let relative = places.find("..\\meshes\\a b.stl");
        assert!(relative.is_file() || relative == own.join("urdf/../meshes/a b.stl"), "{relative:?}");
        assert_eq!(places.find("package://arm/no.stl"), own.join("no.stl"));
    }
}
