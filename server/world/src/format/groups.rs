//! Groups of elements that a file names: physical groups of Gmsh, labels in cell arrays of VTK.

use std::collections::BTreeMap;

use serde::Serialize;

/// Name under which the physical groups of Gmsh count as a cell array; meshio uses the same.
pub const GMSH_PHYSICAL: &str = "gmsh:physical";

/// A cell array with more different values numbers its cells rather than naming groups of them.
pub(super) const MOST_GROUPS: usize = 256;

/// Tetrahedra that a file puts into one group.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CellGroup {
    /// Cell array, or [`GMSH_PHYSICAL`].
    pub array: String,
    /// Number of the group: the value in the array.
    pub number: i64,
    /// Name of the group, if the file has one.
    pub name: Option<String>,
    /// Its tetrahedra, ascending.
    #[serde(serialize_with = "count")]
    pub tets: Vec<u32>,
}

/// Reports tell how many tetrahedra there are, not which.
fn count<S: serde::Serializer>(tets: &[u32], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u64(tets.len() as u64)
}

/// The values of a cell array, by the cell of the file.
#[derive(Clone, Debug, Default)]
pub(super) struct Labels {
    /// Name of the array.
    pub array: String,
    /// Cell and value; a cell may have several.
    pub values: Vec<(u32, i64)>,
    /// Names of values.
    pub names: BTreeMap<i64, String>,
}

impl Labels {
    /// The values of an array with one value per cell, of which the first has number `first_cell`. `None` if one of
    /// them is no integer.
    pub(super) fn of_reals(array: &str, first_cell: u32, values: &[f64]) -> Option<Self> {
        let whole = |value: &f64| value.fract() == 0.0 && value.abs() < 1e15;
        values.iter().all(whole).then(|| {
            let values = values.iter().map(|&value| value as i64);
            Self { array: array.to_owned(), values: (first_cell..).zip(values).collect(), ..Self::default() }
        })
    }

    /// The groups of tetrahedra with the same value. `cell_of_tet` is the file's cell of every tetrahedron, ascending.
    /// Empty if there are more than [`MOST_GROUPS`].
    pub(super) fn groups(self, cell_of_tet: &[u32]) -> Vec<CellGroup> {
        let mut groups: BTreeMap<i64, Vec<u32>> = BTreeMap::new();
        for &(cell, number) in &self.values {
            let Ok(tet) = cell_of_tet.binary_search(&cell) else { continue };
            groups.entry(number).or_default().push(tet as u32);
            if groups.len() > MOST_GROUPS {
                return Vec::new();
            }
        }
        let group = |(number, mut tets): (i64, Vec<u32>)| {
            tets.sort_unstable();
            tets.dedup();
            CellGroup { array: self.array.clone(), number, name: self.names.get(&number).cloned(), tets }
        };
        groups.into_iter().map(group).collect()
    }
}

/// Follows tetrahedra that were left out: `kept` are the ones that remain, ascending. Groups without any stay.
pub fn keep_tets(groups: &mut [CellGroup], kept: &[u32]) {
    for group in groups {
        let place = |tet: &u32| kept.binary_search(tet).ok().map(|at| at as u32);
        group.tets = group.tets.iter().filter_map(place).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_other_cells_and_numberings_make_no_groups() {
        // Cells 1 and 4 are tetrahedra.
        let labels = Labels::of_reals("label", 0, &[9.0, 2.0, 9.0, 9.0, 2.0]).unwrap();
        let groups = labels.groups(&[1, 4]);
        assert_eq!(groups.len(), 1);
        assert_eq!((groups[0].number, &groups[0].tets[..]), (2, &[0, 1][..]));
        assert!(Labels::of_reals("pressure", 0, &[0.5]).is_none());
        let numbers: Vec<f64> = (0..1000).map(f64::from).collect();
        let all: Vec<u32> = (0..1000).collect();
        assert!(Labels::of_reals("id", 0, &numbers).unwrap().groups(&all).is_empty());
    }

    #[test]
    fn groups_follow_tetrahedra_that_are_left_out() {
        let mut groups = [CellGroup { tets: vec![0, 2, 3], ..CellGroup::default() }];
        keep_tets(&mut groups, &[1, 2, 3]);
        assert_eq!(groups[0].tets, [1, 2]);
    }
}
