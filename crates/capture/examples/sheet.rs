//! Puts images side by side into one PNG, to look at: `sheet OUT.png COLUMNS IMAGE...`.

use image::{GenericImage, RgbImage, imageops};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [out, columns, paths @ ..] = &args[..] else { return Err("sheet OUT.png COLUMNS IMAGE...".into()) };
    let columns: u32 = columns.parse()?;
    let images: Vec<RgbImage> =
        paths.iter().map(|p| Ok(image::open(p)?.into_rgb8())).collect::<Result<_, image::ImageError>>()?;
    let (w, h) = images.iter().fold((1, 1), |(w, h), i| (w.max(i.width()), h.max(i.height())));
    let rows = (images.len() as u32).div_ceil(columns);
    let mut sheet = RgbImage::from_pixel(w * columns, h * rows, image::Rgb([90, 90, 90]));
    for (i, image) in images.iter().enumerate() {
        sheet.copy_from(image, w * (i as u32 % columns), h * (i as u32 / columns))?;
    }
    // Big sheets are shrunk to what a screen shows.
    let scale = (1600.0 / f64::from(sheet.width())).min(1.0);
    let size = |x: u32| (f64::from(x) * scale) as u32;
    imageops::resize(&sheet, size(sheet.width()), size(sheet.height()), imageops::FilterType::Triangle).save(out)?;
    Ok(())
}
