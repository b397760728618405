//! Materials of COLLADA: the diffuse colour or texture of the effect that a primitive's material
//! symbol is bound to.

use super::{GREY, Library, beside};
use crate::object::Material;
use crate::object::xml::children;
use roxmltree::Node;
use std::collections::HashMap;
use std::path::Path;

/// Finds materials and keeps those that it has found.
pub(super) struct Looks<'a, 'i> {
    file: &'a Path,
    by_id: HashMap<&'a str, Node<'a, 'i>>,
    known: HashMap<roxmltree::NodeId, Option<u32>>,
}

impl<'a, 'i> Looks<'a, 'i> {
    pub fn new(file: &'a Path, by_id: &HashMap<&'a str, Node<'a, 'i>>) -> Self {
        Self { file, by_id: by_id.clone(), known: HashMap::new() }
    }

    /// The library's material for the symbol of a primitive, as an instance binds it. Without a
    /// binding the symbol may be the material's own id.
    pub fn material(
        &mut self,
        library: &mut Library,
        symbol: Option<&str>,
        instance: Option<Node<'a, 'i>>,
    ) -> Option<u32> {
        let symbol = symbol?;
        let bound = instance.and_then(|i| {
            let mut all = i.descendants().filter(|n| n.tag_name().name() == "instance_material");
            self.target(all.find(|n| n.attribute("symbol") == Some(symbol))?.attribute("target")?)
        });
        let material = bound.or_else(|| self.target(symbol))?;
        if let Some(known) = self.known.get(&material.id()) {
            return *known;
        }
        let looks = self.of(library, material).map(|m| library.material(m));
        self.known.insert(material.id(), looks);
        looks
    }

    fn target(&self, reference: &str) -> Option<Node<'a, 'i>> {
        self.by_id.get(reference.trim_start_matches('#')).copied()
    }

    fn of(&self, library: &mut Library, material: Node<'a, 'i>) -> Option<Material> {
        let effect = self.target(children(material, "instance_effect").next()?.attribute("url")?)?;
        let models = ["phong", "lambert", "blinn", "constant"];
        let model = effect.descendants().find(|n| models.contains(&n.tag_name().name()))?;
        let key = if model.tag_name().name() == "constant" { "emission" } else { "diffuse" };
        let looks = children(model, key).next()?;
        if let Some(texture) = children(looks, "texture").next() {
            let image = self.image(effect, texture.attribute("texture")?)?;
            let texture = library.texture_if_there(&beside(self.file, &image));
            return Some(Material { color: if texture.is_some() { [1.0; 3] } else { GREY }, texture });
        }
        let color = children(looks, "color").next()?.text()?;
        let numbers: Vec<f32> = color.split_whitespace().map_while(|w| w.parse().ok()).collect();
        let color: [f32; 3] = numbers.get(..3)?.try_into().ok()?;
        color.iter().all(|c| c.is_finite()).then_some(Material { color, texture: None })
    }

    /// The file of a texture: by sampler and surface (COLLADA 1.4), by sampler and image (1.5), or
    /// by the image's own id.
    fn image(&self, effect: Node<'a, 'i>, name: &str) -> Option<String> {
        let parameter = |sid: &str| {
            effect.descendants().find(|n| n.tag_name().name() == "newparam" && n.attribute("sid") == Some(sid))
        };
        let word = |n: Node<'a, 'i>, key: &str| {
            let inner = n.descendants().find(|d| d.tag_name().name() == key)?;
            inner.text().or_else(|| inner.attribute("url")).map(|t| t.trim().to_string())
        };
        let image = match parameter(name) {
            Some(sampler) => match word(sampler, "source") {
                Some(surface) => word(parameter(&surface)?, "init_from")?,
                None => word(sampler, "instance_image")?,
            },
            None => name.to_string(),
        };
        let from = self.target(&image)?;
        let from = children(from, "init_from").next()?;
        let named = children(from, "ref").next().unwrap_or(from).text()?.trim();
        Some(named.to_string()).filter(|name| !name.is_empty())
    }
}
