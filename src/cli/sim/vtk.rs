//! Grains as a series of XML PolyData files for ParaView: `grains_000000.vtp` and so on, and `grains.pvd` with their times.
//!
//! One point and one vertex per grain; numbers are stored as their bits (little endian). Show them with the glyph filter:
//! spheres, scaled by `radius_m` with a factor of 2.

use crate::dem::State;
use crate::store::{StoreError, atomic};
use std::fmt::Write as _;
use std::path::PathBuf;

/// The files written so far.
#[derive(Debug)]
pub struct Series {
    folder: PathBuf,
    times: Vec<f64>,
}

impl Series {
    /// An empty series in a folder, which is made with the first file.
    pub fn new(folder: PathBuf) -> Self {
        Self { folder, times: Vec::new() }
    }

    /// Writes the grains at a time [s], and the list of all files so far.
    ///
    /// # Errors
    /// [`StoreError::Io`] naming the file.
    pub fn add(&mut self, state: &State, time: f64) -> Result<(), StoreError> {
        atomic::publish(&self.folder.join(file_name(self.times.len())), &poly_data(state, time))?;
        self.times.push(time);
        atomic::publish(&self.folder.join("grains.pvd"), self.collection().as_bytes())
    }

    fn collection(&self) -> String {
        let mut text =
            String::from("<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\">\n<Collection>\n");
        for (k, time) in self.times.iter().enumerate() {
            // A string takes any text.
            let _ = writeln!(text, "<DataSet timestep=\"{time}\" part=\"0\" file=\"{}\"/>", file_name(k));
        }
        text + "</Collection>\n</VTKFile>\n"
    }
}

fn file_name(number: usize) -> String {
    format!("grains_{number:06}.vtp")
}

/// Arrays of a file: their declarations, and their bytes behind one another.
#[derive(Default)]
struct Arrays {
    bytes: Vec<u8>,
}

impl Arrays {
    /// Appends an array, a length of eight bytes before it; gives its declaration.
    fn add<const N: usize>(
        &mut self,
        kind: &str,
        name: &str,
        components: usize,
        values: impl Iterator<Item = [u8; N]>,
    ) -> String {
        let offset = self.bytes.len();
        self.bytes.extend([0; 8]);
        self.bytes.extend(values.flatten());
        let length = (self.bytes.len() - offset - 8) as u64;
        self.bytes[offset..offset + 8].copy_from_slice(&length.to_le_bytes());
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"appended\" \
             offset=\"{offset}\"/>\n"
        )
    }

    fn numbers(&mut self, name: &str, values: &[f64]) -> String {
        self.add("Float64", name, 1, values.iter().map(|x| x.to_le_bytes()))
    }

    fn vectors(&mut self, name: &str, x: &[f64], y: &[f64], z: &[f64]) -> String {
        let rows = x.iter().zip(y).zip(z).flat_map(|((x, y), z)| [*x, *y, *z]);
        self.add("Float64", name, 3, rows.map(f64::to_le_bytes))
    }

    fn counts(&mut self, name: &str, values: impl Iterator<Item = u64>) -> String {
        self.add("UInt64", name, 1, values.map(u64::to_le_bytes))
    }
}

/// The bytes of one file.
fn poly_data(state: &State, time: f64) -> Vec<u8> {
    let (count, mut arrays) = (state.len(), Arrays::default());
    let clock = arrays.numbers("TimeValue", &[time]).replace("NumberOfComponents", "NumberOfTuples");
    let points = arrays.vectors("Points", &state.x, &state.y, &state.z);
    let vertices =
        [arrays.counts("connectivity", 0..count as u64), arrays.counts("offsets", 1..count as u64 + 1)].concat();
    let data = [
        arrays.counts("id", state.id.iter().map(|id| u64::from(*id))),
        arrays.numbers("radius_m", &state.radius),
        arrays.vectors("velocity_m_per_s", &state.vx, &state.vy, &state.vz),
        arrays.vectors("spin_rad_per_s", &state.wx, &state.wy, &state.wz),
    ]
    .concat();
    let head = format!(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n\
         <FieldData>\n{clock}</FieldData>\n\
         <Piece NumberOfPoints=\"{count}\" NumberOfVerts=\"{count}\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n\
         <Points>\n{points}</Points>\n<Verts>\n{vertices}</Verts>\n\
         <PointData Scalars=\"radius_m\" Vectors=\"velocity_m_per_s\">\n{data}</PointData>\n\
         </Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_"
    );
    [head.as_bytes(), &arrays.bytes, b"\n</AppendedData>\n</VTKFile>\n"].concat()
}
