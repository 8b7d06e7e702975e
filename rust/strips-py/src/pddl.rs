//! `Domain` and `Problem`: PDDL texts, checked.

use std::sync::Arc;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use strips_core::pddl::ast::{self, TypeId};
use strips_core::pddl::{self, Source};

use crate::error::pddl_error;

/// What a text may be given as.
#[derive(FromPyObject)]
pub enum Text {
    /// Text.
    Str(String),
    /// Bytes, which must be UTF-8.
    Bytes(PyBackedBytes),
}

impl Text {
    fn source(self, py: Python<'_>, file: &str) -> PyResult<Source> {
        match self {
            Text::Str(text) => Ok(Source::new(file, text)),
            Text::Bytes(bytes) => Source::from_bytes(file, bytes.to_vec()).map_err(|error| pddl_error(py, &error)),
        }
    }
}

/// A planning domain, every name resolved and every type checked.
#[pyclass(frozen, module = "strips_lm._native")]
pub struct Domain {
    pub ast: Arc<ast::Domain>,
    pub source: Arc<Source>,
}

#[pymethods]
impl Domain {
    /// Parses a PDDL domain; `file` is what messages call it.
    ///
    /// Raises `PddlError` where the text is no domain of the supported language.
    #[staticmethod]
    #[pyo3(signature = (text, file = "<domain>"))]
    fn parse(py: Python<'_>, text: Text, file: &str) -> PyResult<Self> {
        let source = text.source(py, file)?;
        let parsed = py.detach(|| pddl::parse_domain(&source)).map_err(|error| pddl_error(py, &error))?;
        Ok(Self { ast: Arc::new(parsed), source: Arc::new(source) })
    }

    /// The domain's name.
    #[getter]
    fn name(&self) -> &str {
        &self.ast.name
    }

    /// Every type with its direct supertypes; `object` comes first.
    #[getter]
    fn types(&self) -> Vec<(&str, Vec<&str>)> {
        self.ast.types.iter().map(|kind| (kind.name.as_str(), type_names(&self.ast, &kind.parents))).collect()
    }

    /// Every constant with its type.
    #[getter]
    fn constants(&self) -> Vec<(&str, String)> {
        self.ast.constants.iter().map(|object| (object.name.as_str(), type_of(&self.ast, &object.types))).collect()
    }

    /// Objects that the domain uses but leaves to problems to declare.
    #[getter]
    fn pending(&self) -> Vec<&str> {
        self.ast.pending.iter().map(|object| object.name.as_str()).collect()
    }

    /// Every predicate with its parameters' types.
    #[getter]
    fn predicates(&self) -> Vec<(&str, Vec<String>)> {
        self.ast.predicates.iter().map(|item| (item.name.as_str(), signature(&self.ast, &item.parameters))).collect()
    }

    /// Every action with its parameters' types.
    #[getter]
    fn actions(&self) -> Vec<(&str, Vec<String>)> {
        self.ast.actions.iter().map(|item| (item.name.as_str(), signature(&self.ast, &item.parameters))).collect()
    }

    /// What was accepted although the standard forbids it, a line each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        warnings(&self.source, &self.ast.warnings)
    }

    /// The domain as PDDL; parsing it gives the same domain again.
    fn to_pddl(&self) -> String {
        pddl::print_domain(&self.ast)
    }

    fn __repr__(&self) -> String {
        format!("<Domain {}: {} actions>", self.ast.name, self.ast.actions.len())
    }
}

/// A problem of a domain.
#[pyclass(frozen, module = "strips_lm._native")]
pub struct Problem {
    pub ast: Arc<ast::Problem>,
    pub domain: Arc<ast::Domain>,
    warnings: Vec<String>,
}

#[pymethods]
impl Problem {
    /// Parses a PDDL problem of `domain`; `file` is what messages call it.
    ///
    /// Raises `PddlError` where the text is no problem of the domain.
    #[staticmethod]
    #[pyo3(signature = (text, domain, file = "<problem>"))]
    fn parse(py: Python<'_>, text: Text, domain: &Domain, file: &str) -> PyResult<Self> {
        let source = text.source(py, file)?;
        let parse = || pddl::parse_problem(&source, &domain.ast, Some(&domain.source));
        let parsed = py.detach(parse).map_err(|error| pddl_error(py, &error))?;
        let warnings = warnings(&source, &parsed.warnings);
        Ok(Self { ast: Arc::new(parsed), domain: domain.ast.clone(), warnings })
    }

    /// The problem's name.
    #[getter]
    fn name(&self) -> &str {
        &self.ast.name
    }

    /// Every object with its type: constants first, then the problem's own.
    #[getter]
    fn objects(&self) -> Vec<(&str, String)> {
        self.ast.objects.iter().map(|object| (object.name.as_str(), type_of(&self.domain, &object.types))).collect()
    }

    /// What was accepted although the standard forbids it, a line each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// The problem as PDDL; parsing it gives the same problem again.
    fn to_pddl(&self) -> String {
        pddl::print_problem(&self.ast, &self.domain)
    }

    /// The same problem with its objects called `names`, which must be all different and leave the domain's as they are.
    ///
    /// Raises `ValueError` otherwise.
    fn rename(&self, names: Vec<String>) -> PyResult<Self> {
        let kept = self.domain.constants.len() + self.domain.pending.len();
        let old = &self.ast.objects;
        let different = names.iter().collect::<std::collections::HashSet<_>>().len() == names.len();
        let keeps = names.len() == old.len() && names.iter().zip(old).take(kept).all(|(new, old)| *new == old.name);
        if !(different && keeps) {
            return Err(PyValueError::new_err("names must be different, one an object, the domain's own unchanged"));
        }
        let mut renamed = ast::Problem::clone(&self.ast);
        renamed.objects.iter_mut().zip(names).for_each(|(object, name)| object.name = name);
        Ok(Self { ast: Arc::new(renamed), domain: self.domain.clone(), warnings: self.warnings.clone() })
    }

    fn __repr__(&self) -> String {
        format!("<Problem {}: {} objects>", self.ast.name, self.ast.objects.len())
    }
}

fn type_names<'a>(domain: &'a ast::Domain, types: &[TypeId]) -> Vec<&'a str> {
    types.iter().map(|id| domain.types[id.index()].name.as_str()).collect()
}

/// A type as PDDL writes it: a name, or `(either a b)`.
fn type_of(domain: &ast::Domain, types: &[TypeId]) -> String {
    match type_names(domain, types).as_slice() {
        [one] => (*one).to_owned(),
        several => format!("(either {})", several.join(" ")),
    }
}

fn signature(domain: &ast::Domain, parameters: &[ast::Parameter]) -> Vec<String> {
    parameters.iter().map(|parameter| type_of(domain, &parameter.types)).collect()
}

fn warnings(source: &Source, warnings: &[ast::Warning]) -> Vec<String> {
    let render = |warning: &ast::Warning| {
        let (line, column) = source.position(warning.span.start());
        format!("{}:{line}:{column}: warning: {}", source.name(), warning.message)
    };
    warnings.iter().map(render).collect()
}
