#include "tunnel_pilot/rviz/overlay.h"

#include <OGRE/Overlay/OgreOverlay.h>
#include <OGRE/Overlay/OgreOverlayContainer.h>
#include <OGRE/Overlay/OgreOverlayManager.h>
#include <OGRE/Overlay/OgrePanelOverlayElement.h>
#include <OgreHardwarePixelBuffer.h>
#include <OgreMaterialManager.h>
#include <OgrePixelFormat.h>
#include <OgreTechnique.h>
#include <OgreTextureManager.h>

namespace tunnel_pilot::hud {
namespace {

const std::string& group() { return Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME; }

// OGRE's names are unique among all that ever were.
std::string freshName() {
  static int count = 0;
  return "tunnel_pilot_hud_" + std::to_string(++count);
}

}  // namespace

Overlay::Overlay() : name_(freshName()) {
  auto& manager = Ogre::OverlayManager::getSingleton();
  overlay_ = manager.create(name_);
  panel_ = static_cast<Ogre::PanelOverlayElement*>(manager.createOverlayElement("Panel", name_));
  panel_->setMetricsMode(Ogre::GMM_PIXELS);
  const Ogre::MaterialPtr material = Ogre::MaterialManager::getSingleton().create(name_, group());
  Ogre::Pass* pass = material->getTechnique(0)->getPass(0);
  pass->setLightingEnabled(false);
  pass->setDepthCheckEnabled(false);
  pass->setDepthWriteEnabled(false);
  pass->setSceneBlending(Ogre::SBF_ONE, Ogre::SBF_ONE_MINUS_SOURCE_ALPHA);  // premultiplied
  pass->createTextureUnitState()->setTextureFiltering(Ogre::TFO_NONE);
  panel_->setMaterialName(name_);
  overlay_->add2D(panel_);
}

Overlay::~Overlay() {
  auto& manager = Ogre::OverlayManager::getSingleton();
  overlay_->remove2D(panel_);
  manager.destroyOverlayElement(panel_);
  manager.destroy(overlay_);
  Ogre::MaterialManager::getSingleton().remove(name_, group());
  if (texture_.get() != nullptr) Ogre::TextureManager::getSingleton().remove(name_, group());
}

void Overlay::show(bool shown) {
  // Nothing to be shown before there is an image.
  if (shown && texture_.get() != nullptr) {
    overlay_->show();
  } else {
    overlay_->hide();
  }
}

void Overlay::place(int left, int top) {
  panel_->setPosition(static_cast<Ogre::Real>(left), static_cast<Ogre::Real>(top));
}

void Overlay::resize(int width, int height) {
  auto& textures = Ogre::TextureManager::getSingleton();
  if (texture_.get() != nullptr) textures.remove(name_, group());
  texture_ = textures.createManual(name_, group(), Ogre::TEX_TYPE_2D, static_cast<Ogre::uint>(width),
                                   static_cast<Ogre::uint>(height), 0, Ogre::PF_A8R8G8B8,
                                   Ogre::TU_DYNAMIC_WRITE_ONLY_DISCARDABLE);
  const Ogre::MaterialPtr material = Ogre::MaterialManager::getSingleton().getByName(name_, group());
  material->getTechnique(0)->getPass(0)->getTextureUnitState(0)->setTextureName(name_);
  panel_->setDimensions(static_cast<Ogre::Real>(width), static_cast<Ogre::Real>(height));
}

void Overlay::setImage(const QImage& image) {
  const auto width = static_cast<Ogre::uint32>(image.width());
  const auto height = static_cast<Ogre::uint32>(image.height());
  if (texture_.get() == nullptr || texture_->getWidth() != width || texture_->getHeight() != height) {
    resize(image.width(), image.height());
  }
  // OGRE only reads from it, though it does not say so.
  auto* bits = const_cast<uchar*>(image.constBits());
  texture_->getBuffer()->blitFromMemory(Ogre::PixelBox(width, height, 1, Ogre::PF_A8R8G8B8, bits));
}

}  // namespace tunnel_pilot::hud
