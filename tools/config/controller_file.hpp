#pragma once

#include "frf/wiring/nominal_stage.hpp"
#include "tools/config/config_visitor.hpp"
#include "tools/config/controller_keys.hpp"
#include "tools/config/yaml_document.hpp"

namespace stageid {

/// Whether `format:` is that of a controller file.
bool is_controller_file(const YamlDocument& document);

/// The controller of a file of format "stageid-controller" (docs/formats.md): state space, transfer functions, or a
/// measured response, with u = r - C y. If it names a `stage`, the rigid body is that of the stage.
/// @throws FileError, FormatError "FILE:LINE:COLUMN: problem; remedy".
NominalStage read_controller_file(const YamlDocument& document);

/// The matrices or transfer functions of such a file, for a loop at its sample rate.
/// @throws FormatError also if the controller is measured or continuous
LinearControllerKeys read_discrete_controller(const YamlDocument& document, double& sample_rate_hz);

/// The keys of a controller file. Used by `stageid config schema`.
void describe_controller_keys(ConfigVisitor& visitor);

}  // namespace stageid
