//! The tensors of a network in burn by name: export, and import with checks.

use std::collections::BTreeMap;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};
use darn_net::weights::NamedTensors;
use darn_net::{NetError, UnetConfig};

use super::{Convolve, Unet};

/// All tensors of a module by name, with the running statistics.
pub fn export<B: Backend, M: Module<B>>(module: &M) -> NamedTensors {
    let mut export = TensorExport {
        path: Vec::new(),
        tensors: BTreeMap::new(),
    };
    module.visit(&mut export);
    export.tensors
}

/// The module with all its tensors replaced.
///
/// # Errors
/// The first tensor (in the module's order) that is missing or has another shape, or an unexpected name.
fn import<B: Backend, M: Module<B>>(module: M, tensors: &NamedTensors) -> Result<M, NetError> {
    let mut import = TensorImport {
        path: Vec::new(),
        tensors,
        used: 0,
        error: None,
    };
    let module = module.map(&mut import);
    if let Some(error) = import.error {
        return Err(error);
    }
    if import.used != tensors.len() {
        let expected = export(&module);
        let name = tensors.keys().find(|name| !expected.contains_key(*name));
        return Err(NetError::UnexpectedTensor {
            name: name.cloned().unwrap_or_default(),
        });
    }
    Ok(module)
}

/// The network of some tensors on a backend.
///
/// # Errors
/// A tensor that is missing, has another shape or an unexpected name.
pub fn build<B: Convolve>(
    architecture: &UnetConfig,
    tensors: &NamedTensors,
    device: &B::Device,
) -> Result<Unet<B>, NetError> {
    import(Unet::<B>::init(architecture, device), tensors)
}

struct TensorExport {
    path: Vec<String>,
    tensors: NamedTensors,
}

impl<B: Backend> ModuleVisitor<B> for TensorExport {
    fn enter_module(&mut self, name: &str, _container: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        let tensor = param.val();
        let shape = tensor.dims().to_vec();
        let values: Vec<f32> = tensor
            .into_data()
            .convert::<f32>()
            .into_vec()
            .unwrap_or_default();
        self.tensors.insert(self.path.join("."), (shape, values));
    }
}

struct TensorImport<'a> {
    path: Vec<String>,
    tensors: &'a NamedTensors,
    used: usize,
    error: Option<NetError>,
}

impl<B: Backend> ModuleMapper<B> for TensorImport<'_> {
    fn enter_module(&mut self, name: &str, _container: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container: &str) {
        self.path.pop();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        let (id, tensor, mapper) = param.consume();
        let name = self.path.join(".");
        let expected = tensor.dims().to_vec();
        let problem = match self.tensors.get(&name) {
            None => NetError::MissingTensor { name },
            Some((shape, values))
                if *shape == expected && values.len() == expected.iter().product::<usize>() =>
            {
                self.used += 1;
                let required = tensor.is_require_grad();
                let data = TensorData::new(values.clone(), expected);
                let loaded = Tensor::from_data(data, &tensor.device()).set_require_grad(required);
                return Param::from_mapped_value(id, loaded, mapper);
            }
            Some((shape, _)) => NetError::Shape {
                name,
                found: shape.clone(),
                expected,
            },
        };
        self.error.get_or_insert(problem);
        Param::from_mapped_value(id, tensor, mapper)
    }
}
