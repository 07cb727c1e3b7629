#pragma once

#include <OgreTexture.h>

#include <QImage>
#include <string>

namespace Ogre {
class Overlay;
class PanelOverlayElement;
}  // namespace Ogre

namespace tunnel_pilot::hud {

/// An image before everything that rviz renders.
class Overlay {
 public:
  Overlay();
  ~Overlay();
  Overlay(const Overlay&) = delete;
  Overlay& operator=(const Overlay&) = delete;

  void show(bool shown);
  void place(int left, int top);  // [pixels] of the render window
  /// Format_ARGB32_Premultiplied.
  void setImage(const QImage& image);

 private:
  void resize(int width, int height);

  std::string name_;
  Ogre::Overlay* overlay_;
  Ogre::PanelOverlayElement* panel_;
  Ogre::TexturePtr texture_;
};

}  // namespace tunnel_pilot::hud
