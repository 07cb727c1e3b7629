#pragma once

#include <QImage>
#include <QSize>

#include "tunnel_pilot/rviz/hud_content.h"

namespace tunnel_pilot::hud {

/// Size of the HUD at scale 1. [pixels]
QSize hudSize();

/// Paints the HUD: a strip of columns for state, speed, articulation, place in the tunnel, network and
/// ages. Translucent, with premultiplied alpha; the state's badge is opaque.
QImage paintHud(const HudContent& content, double scale);

}  // namespace tunnel_pilot::hud
