//! The effects that a study knows: the built-in ones and those it declares.

use super::{Declared, EFFECTS, Effect, EffectError, unknown};
use std::ops::Deref;
use std::sync::Arc;

/// Built-in effects with those of a study.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Library {
    declared: Vec<Arc<Declared>>,
}

/// An effect of a library.
#[derive(Clone)]
pub enum Handle {
    /// Built in.
    BuiltIn(&'static dyn Effect),
    /// Declared by the study.
    Declared(Arc<Declared>),
}

impl Deref for Handle {
    type Target = dyn Effect;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::BuiltIn(effect) => *effect,
            Self::Declared(effect) => effect.as_ref(),
        }
    }
}

impl Library {
    /// Adds an effect, whose name must be new.
    pub fn add(&mut self, effect: Declared) {
        self.declared.push(Arc::new(effect));
    }

    /// Names of the declared effects.
    pub fn declared(&self) -> impl Iterator<Item = &str> {
        self.declared.iter().map(|effect| effect.name())
    }

    /// The effect called `name`.
    ///
    /// # Errors
    /// [`EffectError::Unknown`] with all names.
    pub fn find(&self, name: &str) -> Result<Handle, EffectError> {
        if let Some(effect) = self.declared.iter().find(|effect| effect.name() == name) {
            return Ok(Handle::Declared(Arc::clone(effect)));
        }
        let built_in = EFFECTS.iter().copied().find(|effect| effect.name() == name);
        built_in.map(Handle::BuiltIn).ok_or_else(|| unknown(name, &self.declared().collect::<Vec<_>>()))
    }
}
