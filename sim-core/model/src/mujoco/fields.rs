//! Height fields of a model. MuJoCo has scaled their elevations to 0 to 1.

use super::format::ModelFile;
use crate::error::ModelError;
use crate::geometry::HeightField;

/// The height field that a geom names.
pub(super) fn height_field(file: &ModelFile, place: i64) -> Result<HeightField, ModelError> {
    let count = file.rows("hfield_nrow");
    let fault = |reason: &str| file.fault(format!("has a height field {reason}"));
    let row = usize::try_from(place).ok().filter(|&row| row < count);
    let row = row.ok_or_else(|| fault("that is not there"))?;
    let number = |array: &str| -> Result<usize, ModelError> {
        let all = file.integers(array, count)?;
        usize::try_from(all[row]).map_err(|_| fault("of a negative size"))
    };
    let (rows, columns) = (number("hfield_nrow")?, number("hfield_ncol")?);
    let first = number("hfield_adr")?;
    let [x, y, height, base] = file.vectors::<4>("hfield_size", count)?[row];
    let all = file.reals("hfield_data", file.rows("hfield_data"))?;
    let data = rows.checked_mul(columns).and_then(|count| {
        let end = first.checked_add(count)?;
        all.get(first..end)
    });
    let data = data.ok_or_else(|| fault("without its elevations"))?;
    let elevations = data.iter().map(|x| x * height).collect();
    let field = HeightField::new([rows, columns], elevations, [2.0 * x, 2.0 * y], base);
    // its bottom counts from 0, whatever its lowest elevation is
    let field = field.map_err(|reason| fault(&format!("that cannot be used: {reason}")))?;
    if field.range()[0] <= -base {
        return Err(fault("with an elevation below its base"));
    }
    Ok(HeightField {
        bottom: -base,
        ..field
    })
}
