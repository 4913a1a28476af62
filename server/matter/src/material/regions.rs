//! Regions of a body that have other constants than the rest of it.

use super::{Lame, MaterialError, Region};

/// The constants of the regions of a body, and the region of every element. Region 0 is the body's own material,
/// region n has the constants number n − 1.
///
/// ```
/// use scindo_matter::material::{Region, Regions};
///
/// let tumour = Region { young_pa: 5e4, poisson: 0.45, density_kg_m3: 1060.0 };
/// let regions = Regions::new(vec![tumour], vec![0, 1, 1, 0])?;
/// assert_eq!(regions.of(2), 1);
/// assert_eq!(regions.counts(), [2]);
/// # Ok::<(), scindo_matter::material::RegionsError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Regions {
    constants: Vec<Region>,
    /// Empty if there are no regions.
    of_element: Vec<u16>,
}

/// Why regions cannot be used.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum RegionsError {
    /// A constant of a region is outside its range.
    #[error("region {region}: {error}")]
    Constant {
        /// Number of the region, from 1.
        region: usize,
        /// The constant.
        error: MaterialError,
    },
    /// An element names a region that there is not.
    #[error("element {element} is of region {found}, but there are {regions} regions")]
    Number {
        /// Number of the element.
        element: usize,
        /// Region found.
        found: u16,
        /// Number of regions.
        regions: usize,
    },
    /// There is not one region per element.
    #[error("found the regions of {found} elements, the mesh has {expected}")]
    Length {
        /// Elements whose region is given.
        found: usize,
        /// Elements of the mesh.
        expected: usize,
    },
}

impl Regions {
    /// Regions with these constants, and the region of every element.
    ///
    /// # Errors
    /// A constant outside its range, or the number of a region that there is not.
    pub fn new(constants: Vec<Region>, of_element: Vec<u16>) -> Result<Self, RegionsError> {
        for (region, constants) in (1..).zip(&constants) {
            constants.check().map_err(|error| RegionsError::Constant { region, error })?;
        }
        let regions = constants.len();
        let unknown = of_element.iter().position(|&region| usize::from(region) > regions);
        if let Some(element) = unknown {
            return Err(RegionsError::Number { element, found: of_element[element], regions });
        }
        if of_element.iter().all(|&region| region == 0) {
            return Ok(Self::default());
        }
        Ok(Self { constants, of_element })
    }

    /// Checks that there is one region per element of a mesh of `elements` elements, or none at all.
    ///
    /// # Errors
    /// Another number of elements.
    pub fn check_length(&self, elements: usize) -> Result<(), RegionsError> {
        let found = self.of_element.len();
        if self.is_empty() || found == elements {
            return Ok(());
        }
        Err(RegionsError::Length { found, expected: elements })
    }

    /// Whether all elements have the material of the body.
    pub fn is_empty(&self) -> bool {
        self.constants.is_empty()
    }

    /// Region of element `e`.
    #[inline]
    pub fn of(&self, e: usize) -> u16 {
        self.of_element.get(e).copied().unwrap_or(0)
    }

    /// Region of every element; empty if all have the material of the body.
    pub fn of_elements(&self) -> &[u16] {
        &self.of_element
    }

    /// Constants of the regions 1, 2, ….
    pub fn constants(&self) -> &[Region] {
        &self.constants
    }

    /// The regions of pieces of the elements `of_piece`.
    pub fn of_pieces(&self, of_piece: impl Iterator<Item = u32>) -> Self {
        let mut pieces = Self::without_elements(self.constants.clone());
        pieces.refill(of_piece.map(|e| self.of(e as usize)));
        pieces
    }

    /// Notes the region of one element more.
    pub fn push(&mut self, region: u16) {
        if !self.is_empty() {
            self.of_element.push(region);
        }
    }

    /// Replaces the regions of all elements.
    pub fn refill(&mut self, of_element: impl Iterator<Item = u16>) {
        self.of_element.clear();
        if !self.is_empty() {
            self.of_element.extend(of_element);
        }
    }

    /// Regions with these constants, which have been checked, and no elements yet.
    pub fn without_elements(constants: Vec<Region>) -> Self {
        Self { constants, of_element: Vec::new() }
    }

    /// Number of elements of the regions 1, 2, ….
    pub fn counts(&self) -> Vec<usize> {
        let mut counts = vec![0; self.constants.len()];
        for region in self.of_element.iter().filter_map(|&region| usize::from(region).checked_sub(1)) {
            counts[region] += 1;
        }
        counts
    }

    /// Lamé constants [Pa] of the elements of `region` in a body whose own are `lame`.
    pub fn lame(&self, region: u16, lame: Lame) -> Lame {
        Region::numbered(&self.constants, region).map_or(lame, Region::lame)
    }

    /// Density of element `e` relative to that of its body, `density_kg_m3`.
    pub fn relative_density(&self, e: usize, density_kg_m3: f64) -> f64 {
        Region::numbered(&self.constants, self.of(e))
            .map_or(1.0, |region| region.density_kg_m3 / density_kg_m3)
    }
}
