//! Scenes that a server can change to while it runs. `rpc/scenes` lists them, `rpc/load` asks for one.
//!
//! A requested scene is built while the present one goes on. Then the server starts anew with it, on the same
//! sessions. Clients see the server go and come, as they do at a restart.

use std::sync::{Mutex, MutexGuard, PoisonError};

use scindo_proto::messages::{SceneEntry, ScenesReply};
use scindo_world::scene::{SHIPPED, Scene, SceneError, ShippedScene};

use crate::inbox::Refusal;

/// Origin of a scene in the list.
#[derive(Debug, Clone)]
enum Source {
    Shipped(ShippedScene),
    /// The scene that the server was started with.
    Own(Box<Scene>),
}

#[derive(Debug, Clone)]
struct Listed {
    name: String,
    description: String,
    source: Source,
}

/// The list of scenes, and the one that was asked for.
#[derive(Debug, Default)]
pub struct Catalogue {
    scenes: Vec<Listed>,
    /// Index of the scene that was asked for and does not run yet.
    asked: Mutex<Option<usize>>,
}

impl Catalogue {
    /// A list of the scenes that ship and of `own`, the scene the server starts with. `own` replaces a
    /// shipped scene of the same name.
    pub fn beside(name: &str, own: &Scene) -> Self {
        let listed = |scene: ShippedScene| Listed {
            name: scene.name.to_owned(),
            description: scene.description(),
            source: Source::Shipped(scene),
        };
        let mut scenes: Vec<Listed> = SHIPPED.into_iter().map(listed).collect();
        let source = Source::Own(Box::new(own.clone()));
        match scenes.iter_mut().find(|scene| scene.name == name) {
            Some(scene) => scene.source = source,
            None => {
                let description = match own.description() {
                    "" => "the scene that the server was started with".to_owned(),
                    described => described.to_owned(),
                };
                scenes.insert(0, Listed { name: name.to_owned(), description, source });
            }
        }
        Self { scenes, asked: Mutex::default() }
    }

    /// The list in the form that clients receive.
    pub fn entries(&self) -> ScenesReply {
        let entry =
            |scene: &Listed| SceneEntry { name: scene.name.clone(), description: scene.description.clone() };
        ScenesReply { scenes: self.scenes.iter().map(entry).collect() }
    }

    /// Asks for the scene `name`.
    ///
    /// # Errors
    /// Nothing can be loaded here, there is no such scene, or another one is on its way.
    pub fn ask(&self, name: &str) -> Result<(), Refusal> {
        if self.scenes.is_empty() {
            return Err(Refusal {
                code: "not-supported",
                message:
                    "this server keeps its scene, because it makes a fixed number of steps, writes results \
                    or does not keep pace with real time"
                        .into(),
                hint: "start a server with the scene instead",
            });
        }
        let Some(number) = self.scenes.iter().position(|scene| scene.name == name) else {
            let names: Vec<&str> = self.scenes.iter().map(|scene| &*scene.name).collect();
            return Err(Refusal {
                code: "unknown-scene",
                message: format!("there is no scene '{name}'; the scenes are {}", names.join(", ")),
                hint: "choose one of rpc/scenes",
            });
        };
        let mut asked = self.asked();
        if asked.is_some() {
            return Err(Refusal {
                code: "busy",
                message: "another scene is being built".into(),
                hint: "send it again when that scene runs",
            });
        }
        *asked = Some(number);
        Ok(())
    }

    /// Name and scene that were asked for. The request stays until [`settled`](Self::settled).
    ///
    /// # Errors
    /// Problems of the scene.
    pub fn asked_for(&self) -> Option<(String, Result<Scene, SceneError>)> {
        let number = (*self.asked())?;
        let Listed { name, source, .. } = self.scenes.get(number)?;
        let scene = match source {
            Source::Shipped(scene) => scene.read(&[]),
            Source::Own(scene) => Ok((**scene).clone()),
        };
        Some((name.clone(), scene))
    }

    /// Ends the request: the scene runs, or it cannot.
    pub fn settled(&self) {
        *self.asked() = None;
    }

    fn asked(&self) -> MutexGuard<'_, Option<usize>> {
        self.asked.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn one_scene_at_a_time_is_asked_for_by_its_name() {
        let own = SHIPPED[1].read(&["body.kidney.young_pa=9000".to_owned()]).unwrap();
        let catalogue = Catalogue::beside(SHIPPED[1].name, &own);
        assert_eq!(catalogue.entries().scenes.len(), SHIPPED.len());
        assert!(catalogue.asked_for().is_none());
        assert_eq!(catalogue.ask("kidny").unwrap_err().code, "unknown-scene");
        catalogue.ask(SHIPPED[1].name).unwrap();
        assert_eq!(catalogue.ask(SHIPPED[0].name).unwrap_err().code, "busy");
        let (name, scene) = catalogue.asked_for().unwrap();
        assert_eq!((&*name, scene.unwrap().checked().bodies[0].young_pa), (SHIPPED[1].name, 9000.0));
        catalogue.settled();
        assert!(catalogue.asked_for().is_none());

        let beside = Catalogue::beside("mine", &own);
        assert_eq!(beside.entries().scenes[0].name, "mine");
        assert_eq!(beside.entries().scenes.len(), SHIPPED.len() + 1);
        assert_eq!(Catalogue::default().ask("kidney").unwrap_err().code, "not-supported");
    }
}
